/* Flights and maxima of periodic orbits of random bodies against the flow used for runs. A flight from one impact must
 * reach the next impact as the periodic response predicts. */
#include "door/orbits.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "check.h"
#include "door/orbit_maximum.h"
#include "orbit_case.h"

enum { SAMPLES = 300 };

/* Coefficient n + 1 of the powers of time in the motion of coupled modes, from the coefficient n. */
static void next_coefficient(const vi_orbit_body *body, double n, double x[], double v[], double force[])
{
    const int modes = body->modes;
    double faster[MODES];
    for (int j = 0; j < modes; ++j) {
        faster[j] = force[j] - body->natural[j] * body->natural[j] * x[j];
        for (int i = 0; i < modes; ++i) {
            faster[j] -= damping[j * modes + i] * v[i];
        }
    }
    for (int j = 0; j < modes; ++j) {
        x[j] = v[j] / (n + 1.0);
        v[j] = faster[j] / (n + 1.0);
    }
}

/* Derivative n of sine k of the modal force over n factorial, at a phase of the clock. */
static void add_force(const vi_orbit_body *body, int k, int n, double phase, double force[])
{
    const double w = body->order[k] * body->angular_frequency;
    double turned = 1.0; /* w^n / n! */
    for (int i = 1; i <= n; ++i) {
        turned *= w / i;
    }
    const double angle = body->order[k] * phase + 0.25 * TURN * n; /* each derivative turns by a quarter */
    for (int j = 0; j < body->modes; ++j) {
        force[j] += turned
                    * (body->cosine[k * body->modes + j] * cos(angle) + body->sine[k * body->modes + j] * sin(angle));
    }
}

/* Fly modes that are coupled, by power series over short steps. */
static void fly_coupled(const vi_orbit_body *body, const double state[], double phase, double u, double end[])
{
    const int modes = body->modes, steps = 1 + (int)(u * 40.0);
    const double h = u / steps;
    memcpy(end, state, (size_t)(2 * modes) * sizeof *end);
    for (int step = 0; step < steps; ++step) {
        double x[MODES], v[MODES], power = h; /* h^(n + 1) */
        memcpy(x, end, (size_t)modes * sizeof *x);
        memcpy(v, end + modes, (size_t)modes * sizeof *v);
        for (int n = 0; n < 30; ++n) {
            double force[MODES];
            for (int j = 0; j < modes; ++j) {
                force[j] = n == 0 ? body->held[j] : 0.0;
            }
            for (int k = 0; k < body->harmonics; ++k) {
                add_force(body, k, n, phase + body->angular_frequency * h * step, force);
            }
            next_coefficient(body, n, x, v, force);
            for (int j = 0; j < modes; ++j) {
                end[j] += x[j] * power;
                end[modes + j] += v[j] * power;
            }
            power *= h;
        }
    }
}

/* Fly mode j under sine k of the force for u seconds from (x, v), on the core's exact flow. */
static void fly_mode(const vi_orbit_body *body, int j, int k, double held, double phase, double u, double *x, double *v)
{
    const double natural = body->natural[j], w = body->order[k] * body->angular_frequency;
    const double c = body->cosine[k * body->modes + j], s = body->sine[k * body->modes + j];
    const double angle = body->order[k] * phase - atan2(s, c);
    vi_mode mode;
    vi_mode_start(&mode, 1.0, 2.0 * body->damping_ratio[j] * natural, natural * natural, hypot(c, s), w);
    for (double done = 0.0; done < u;) { /* segments are short near a resonance */
        vi_segment segment;
        vi_motion motion;
        vi_segment_start(&segment, &mode, *x, *v, vi_phase_of(angle + w * done), held, 0.0, u - done, false);
        vi_segment_at(&segment, segment.length, &motion);
        *x = segment.origin + motion.x;
        *v = motion.v;
        done = segment.length < u - done ? done + segment.length : u;
    }
}

/* Fly all modes from `state` at `phase` for u seconds. The responses to the sines after the first add up. */
static void fly(const vi_orbit_body *body, const double state[], double phase, double u, double end[])
{
    const int modes = body->modes;
    if (body->coupling) {
        fly_coupled(body, state, phase, u, end);
        return;
    }
    memcpy(end, state, (size_t)(2 * modes) * sizeof *end);
    for (int j = 0; j < modes; ++j) {
        fly_mode(body, j, 0, body->held[j], phase, u, &end[j], &end[modes + j]);
        for (int k = 1; k < body->harmonics; ++k) {
            double x = 0.0, v = 0.0;
            fly_mode(body, j, k, 0.0, phase, u, &x, &v);
            end[j] += x;
            end[modes + j] += v;
        }
    }
}

static double at_contact(const vi_orbit_body *body, int contact, const double row[])
{
    double sum = 0.0;
    for (int j = 0; j < body->modes; ++j) {
        sum += body->shape[contact * body->modes + j] * row[j];
    }
    return body->direction[contact] * sum;
}

/* Displacement of a contact towards its stop, less that of the stop, at a phase of the clock; order 1: its velocity. */
static double beyond_stop(const vi_orbit_body *body, int contact, const double row[], double phase, int order)
{
    double moved = order == 0 ? body->position[contact] : 0.0;
    for (int k = 0; k < body->harmonics; ++k) {
        const double w = order == 0 ? 1.0 : body->order[k] * body->angular_frequency;
        const double angle = body->order[k] * phase + 0.25 * TURN * order;
        moved += w
                 * (body->stop_cosine[k * body->contacts + contact] * cos(angle)
                    + body->stop_sine[k * body->contacts + contact] * sin(angle));
    }
    return at_contact(body, contact, row) - body->direction[contact] * moved;
}

static double largest(const double row[], int count)
{
    double size = 0.0;
    for (int j = 0; j < count; ++j) {
        size = fmax(size, fabs(row[j]));
    }
    return size;
}

static double flight(const orbit_case *drawn, int i)
{
    const int n = drawn->train.impacts;
    const double from = drawn->phase[i];
    const double to = i + 1 < n ? drawn->phase[i + 1] : drawn->phase[0] + TURN * drawn->train.periods;
    return (to - from) / drawn->body.angular_frequency;
}

/* Each flight ends at the next impact with the predicted distance, velocity and state. */
static void check_flights(const orbit_case *drawn, const double velocity[], const double distance[],
                          const double state[])
{
    const vi_orbit_body *body = &drawn->body;
    const int n = drawn->train.impacts, modes = body->modes;
    for (int i = 0; i < n; ++i) {
        const int next = (i + 1) % n;
        const int32_t contact = drawn->contact[next];
        const double *start = state + (ptrdiff_t)i * 2 * modes, *after = state + (ptrdiff_t)next * 2 * modes;
        double end[2 * MODES];
        fly(body, start, drawn->phase[i], flight(drawn, i), end);
        const double size = 1.0 + largest(start, 2 * modes) + largest(end, 2 * modes), close = 1e-10 * size;
        const double beyond = beyond_stop(body, contact, end, drawn->phase[next], 0);
        const double speed = beyond_stop(body, contact, end + modes, drawn->phase[next], 1);
        CHECK(fabs(beyond - distance[next]) <= close, "impact %d: %.17g, %.17g", next, beyond, distance[next]);
        CHECK(fabs(speed - velocity[next]) <= close, "impact %d: %.17g, %.17g", next, speed, velocity[next]);
        for (int j = 0; j < modes; ++j) {
            const double yield = body->yield_velocity[contact];
            const double falls = yield > 0.0 && speed > yield ? pow(speed / yield, -0.25) : 1.0;
            const double taken = (1.0 + falls * body->restitution[contact]) * body->direction[contact] * speed
                                 * body->impulse[contact * modes + j];
            CHECK(fabs(end[j] - after[j]) <= close, "impact %d, mode %d", next, j);
            CHECK(fabs(end[modes + j] - taken - after[modes + j]) <= close, "impact %d, mode %d", next, j);
        }
    }
}

/* The contact reaches the reported maximum at the reported phase. */
static void check_attained(const orbit_case *drawn, const double state[], const double what[3])
{
    const vi_orbit_body *body = &drawn->body;
    const int contact = (int)what[2];
    double end[2 * MODES];
    int i = drawn->train.impacts - 1;
    while (i > 0 && what[1] < drawn->phase[i]) {
        --i;
    }
    const double u = fmax(0.0, (what[1] - drawn->phase[i]) / body->angular_frequency);
    fly(body, state + (ptrdiff_t)i * 2 * body->modes, drawn->phase[i], u, end);
    const double beyond = beyond_stop(body, contact, end, what[1], 0);
    CHECK(fabs(beyond - what[0]) <= 1e-9 * (1.0 + fabs(what[0])), "%.17g at %g, not %.17g", beyond, what[1], what[0]);
}

/* An impact may reverse other contacts: these kinks are maxima. */
static void check_kinks(const orbit_case *drawn, const double state[], double highest)
{
    const vi_orbit_body *body = &drawn->body;
    const int n = drawn->train.impacts, states = 2 * body->modes;
    for (int i = 0; i < n; ++i) {
        const int next = (i + 1) % n;
        const double *after = state + (ptrdiff_t)next * states;
        double end[2 * MODES];
        fly(body, state + (ptrdiff_t)i * states, drawn->phase[i], flight(drawn, i), end);
        for (int contact = 0; contact < body->contacts; ++contact) {
            const double phase = drawn->phase[next];
            if (contact != drawn->contact[next] && beyond_stop(body, contact, end + body->modes, phase, 1) > 1e-9
                && beyond_stop(body, contact, after + body->modes, phase, 1) < -1e-9) {
                const double beyond = beyond_stop(body, contact, after, phase, 0);
                CHECK(beyond <= highest + 1e-9 * (1.0 + fabs(beyond)), "kink of contact %d: %.17g, %.17g", contact,
                      beyond, highest);
            }
        }
    }
}

/* No sample of any contact within a flight is beyond the highest maximum, unless the contact is on its way to an
 * impact. */
static void check_maximum(const orbit_case *drawn, const double state[])
{
    const vi_orbit_body *body = &drawn->body;
    double what[3];
    CHECK(vi_door_orbit_maximum(body, &drawn->train, state, what) == VI_ORBIT_DONE, "maximum");
    check_kinks(drawn, state, what[0]);
    if (what[2] >= 0.0) {
        check_attained(drawn, state, what);
    }
    const double close = 1e-9 * (1.0 + fabs(what[0] > -HUGE_VAL ? what[0] : 0.0));
    for (int i = 0; i < drawn->train.impacts; ++i) {
        const double *start = state + (ptrdiff_t)i * 2 * body->modes, length = flight(drawn, i);
        for (int contact = 0; contact < body->contacts; ++contact) {
            double beyond[SAMPLES + 1];
            for (int k = 0; k <= SAMPLES; ++k) {
                double now[2 * MODES];
                const double u = length * k / SAMPLES;
                fly(body, start, drawn->phase[i], u, now);
                beyond[k] = beyond_stop(body, contact, now, drawn->phase[i] + body->angular_frequency * u, 0);
            }
            for (int k = 1; k < SAMPLES; ++k) {
                if (beyond[k] >= beyond[k - 1] && beyond[k] >= beyond[k + 1]) {
                    CHECK(beyond[k] <= what[0] + close, "contact %d: %.17g, %.17g", contact, beyond[k], what[0]);
                }
            }
        }
    }
}

/* The distance of one impact is the given sum of sines of its phase. */
static void check_wave(const orbit_case *drawn)
{
    double phase = 0.0;
    vi_orbit_wave wave;
    vi_orbit_train one = {.impacts = 1, .periods = drawn->train.periods, .contact = drawn->contact, .phase = &phase};
    CHECK(vi_door_orbit_wave(&drawn->body, &one, &wave) == VI_ORBIT_DONE, "wave");
    for (phase = 0.0; phase < TURN; phase += 0.7) {
        double velocity, distance, slopes[2], slope, sum = wave.level, size = fabs(wave.level), steady = 0.0;
        CHECK(vi_door_orbit(&drawn->body, &one, &velocity, &distance, &slopes[0], &slopes[1]) == VI_ORBIT_DONE,
              "impact");
        for (int k = 0; k < drawn->body.harmonics; ++k) {
            const double angle = drawn->order[k] * phase;
            const double w = drawn->order[k] * drawn->body.angular_frequency;
            sum += wave.steady_cosine[k] * cos(angle) + wave.steady_sine[k] * sin(angle);
            steady += w * (wave.steady_sine[k] * cos(angle) - wave.steady_cosine[k] * sin(angle));
            size += fabs(wave.cosine[k]) + fabs(wave.sine[k]);
        }
        const double equal = vi_orbit_equal_speed(&drawn->body, one.contact[0], velocity, &slope);
        sum += wave.answer[0] * equal;
        size += fabs(wave.answer[0] * equal) + fabs(wave.answer[1] * equal);
        CHECK(fabs(velocity - steady - wave.answer[1] * equal) <= 1e-12 * (size + fabs(steady)), "at %g", phase);
        CHECK(fabs(distance - sum) <= 1e-12 * size, "at %g: %.17g, not %.17g", phase, sum, distance);
    }
}

static int check_random_orbits(uint64_t *seed, int count, bool coupled)
{
    int evaluated = 0;
    for (int each = 0; each < count; ++each) {
        orbit_case drawn;
        double velocity[IMPACTS], distance[IMPACTS], slopes[IMPACTS * IMPACTS], faster[IMPACTS * IMPACTS];
        double state[IMPACTS * 2 * MODES], monodromy[4 * MODES * MODES];
        draw(seed, &drawn);
        if (coupled) {
            couple(seed, &drawn);
        }
        const int end = vi_door_orbit(&drawn.body, &drawn.train, velocity, distance, slopes, faster);
        CHECK(end == VI_ORBIT_DONE, "case %d: %d", each, end);
        check_wave(&drawn);
        if (largest(velocity, drawn.train.impacts) > 1e3) {
            continue; /* near a resonance of an undamped mode */
        }
        ++evaluated;
        CHECK(vi_door_orbit_motion(&drawn.body, &drawn.train, velocity, state, monodromy) == VI_ORBIT_DONE, "motion");
        check_flights(&drawn, velocity, distance, state);
        if (each % (coupled ? 40 : 4) == 0) {
            check_maximum(&drawn, state);
        }
    }
    return evaluated;
}

static int end_of(const orbit_case *drawn)
{
    double numbers[2][IMPACTS], slopes[2][IMPACTS * IMPACTS];
    return vi_door_orbit(&drawn->body, &drawn->train, numbers[0], numbers[1], slopes[0], slopes[1]);
}

/* An undamped mode that returns after the whole train adds up its impacts without bound, for any force. */
static void check_resonances(orbit_case *drawn)
{
    drawn->body.harmonics = 1;
    drawn->order[0] = 1.0;
    for (int turns = 1; turns < 40; ++turns) {
        for (int periods = 1; periods <= 3; ++periods) {
            drawn->train.periods = periods;
            drawn->natural[0] = turns * drawn->body.angular_frequency / periods;
            drawn->damping_ratio[0] = 0.0;
            CHECK(end_of(drawn) == VI_ORBIT_RESONANT, "%d turns in %d periods", turns, periods);
            drawn->natural[0] *= 1.0 + 1e-6;
            CHECK(end_of(drawn) != VI_ORBIT_RESONANT, "next to %d turns in %d periods", turns, periods);
            drawn->natural[0] /= 1.0 + 1e-6;
            drawn->damping_ratio[0] = 1e-6;
            CHECK(end_of(drawn) != VI_ORBIT_RESONANT, "damped, %d turns in %d periods", turns, periods);
        }
    }
}

static void check_refusals(uint64_t *seed)
{
    orbit_case good;
    do {
        draw(seed, &good);
    } while (good.train.impacts < 2);
    orbit_case bad;
#define REFUSED(change)                                                                                                \
    do {                                                                                                               \
        bad = good;                                                                                                    \
        bad.body.natural = bad.natural;                                                                                \
        bad.body.damping_ratio = bad.damping_ratio;                                                                    \
        bad.body.direction = bad.direction;                                                                            \
        bad.body.restitution = bad.restitution;                                                                        \
        bad.body.order = bad.order;                                                                                    \
        bad.body.sine = bad.sine;                                                                                      \
        bad.body.stop_cosine = bad.stop_cosine;                                                                        \
        bad.train.phase = bad.phase;                                                                                   \
        bad.train.contact = bad.contact;                                                                               \
        change;                                                                                                        \
        CHECK(end_of(&bad) == VI_ORBIT_REFUSED, "%s", #change);                                                        \
    } while (0)
    REFUSED(bad.body.modes = 0);
    REFUSED(bad.body.modes = VI_MODES + 1);
    REFUSED(bad.body.harmonics = 0);
    REFUSED(bad.body.harmonics = VI_ORBIT_HARMONICS + 1);
    REFUSED(bad.order[0] = 0.0);
    REFUSED(bad.order[0] = 1.5);
    REFUSED(bad.sine[0] = (double)NAN);
    REFUSED(bad.stop_cosine[0] = (double)INFINITY);
    REFUSED(bad.body.contacts = 0);
    REFUSED(bad.body.contacts = VI_ORBIT_CONTACTS + 1);
    REFUSED(bad.body.angular_frequency = 0.0);
    REFUSED(bad.body.angular_frequency = (double)NAN);
    REFUSED(bad.natural[0] = 0.0; bad.damping_ratio[0] = 0.1);
    REFUSED(bad.natural[0] = (double)INFINITY);
    REFUSED(bad.damping_ratio[0] = (double)NAN);
    REFUSED(bad.direction[0] = 0.5);
    REFUSED(bad.restitution[0] = 1.1);
    REFUSED(bad.restitution[0] = (double)NAN);
    REFUSED(bad.train.impacts = 0);
    REFUSED(bad.train.impacts = VI_ORBIT_IMPACTS + 1);
    REFUSED(bad.train.periods = 0);
    REFUSED(bad.contact[0] = -1);
    REFUSED(bad.contact[0] = bad.body.contacts);
    REFUSED(bad.phase[1] = bad.phase[0]);
    REFUSED(bad.phase[0] = (double)NAN);
    REFUSED(bad.phase[bad.train.impacts - 1] = bad.phase[0] + TURN * bad.train.periods);
}

int main(void)
{
    uint64_t seed = 17;
    const int evaluated = check_random_orbits(&seed, 600, false), coupled = check_random_orbits(&seed, 150, true);
    CHECK(evaluated > 400 && coupled > 120, "only %d and %d", evaluated, coupled);
    orbit_case one;
    do {
        draw(&seed, &one);
    } while (one.train.impacts != 1 || one.body.modes != 1);
    check_resonances(&one);
    check_refusals(&seed);
    return 0;
}
