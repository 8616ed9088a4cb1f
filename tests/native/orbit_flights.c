/* Flights and maxima of periodic orbits of random bodies against the flow used for runs. A flight from one impact must
 * reach the next impact as the periodic response predicts. */
#include "door/orbits.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "check.h"
#include "door/orbit_maximum.h"

enum { MODES = 6, CONTACTS = 3, IMPACTS = 4, SAMPLES = 300 };

static const double TURN = 6.283185307179586;

typedef struct {
    vi_orbit_body body;
    vi_orbit_train train;
    double natural[MODES], damping_ratio[MODES], cosine[MODES], sine[MODES], held[MODES];
    double shape[CONTACTS * MODES], impulse[CONTACTS * MODES];
    double direction[CONTACTS], position[CONTACTS], restitution[CONTACTS];
    int32_t contact[IMPACTS];
    double phase[IMPACTS];
} orbit_case;

/* Damping between the modes of the present case, with its complex modes. */
static double damping[MODES * MODES];
static vi_orbit_coupling coupling;
static vi_coupled_work work;

static double random_ratio(uint64_t *seed)
{
    const double ratios[] = {0.0, 1.0, 1.0 - 1e-9, 1.0 + 1e-9, uniform(seed, 0.0, 0.3), uniform(seed, 0.3, 3.0)};
    return ratios[choice(seed, 6)];
}

static void draw(uint64_t *seed, orbit_case *drawn)
{
    vi_orbit_body *body = &drawn->body;
    *body = (vi_orbit_body){.modes = 1 + (int)choice(seed, MODES),
                            .contacts = 1 + (int)choice(seed, CONTACTS),
                            .angular_frequency = uniform(seed, 0.4, 3.0),
                            .natural = drawn->natural,
                            .damping_ratio = drawn->damping_ratio,
                            .cosine = drawn->cosine,
                            .sine = drawn->sine,
                            .held = drawn->held,
                            .shape = drawn->shape,
                            .impulse = drawn->impulse,
                            .direction = drawn->direction,
                            .position = drawn->position,
                            .restitution = drawn->restitution};
    for (int j = 0; j < body->modes; ++j) {
        drawn->natural[j] = uniform(seed, 0.3, 6.0);
        drawn->damping_ratio[j] = random_ratio(seed);
        drawn->cosine[j] = uniform(seed, -1.0, 1.0);
        drawn->sine[j] = uniform(seed, -1.0, 1.0);
        drawn->held[j] = uniform(seed, -0.2, 0.2);
    }
    for (int k = 0; k < body->contacts; ++k) {
        double square = 0.0;
        for (int j = 0; j < body->modes; ++j) {
            drawn->shape[k * body->modes + j] = uniform(seed, 0.2, 1.0) * (choice(seed, 2) ? 1.0 : -1.0);
            square += drawn->shape[k * body->modes + j] * drawn->shape[k * body->modes + j];
        }
        for (int j = 0; j < body->modes; ++j) {
            drawn->impulse[k * body->modes + j] = drawn->shape[k * body->modes + j] / square;
        }
        drawn->direction[k] = choice(seed, 2) ? 1.0 : -1.0;
        drawn->position[k] = uniform(seed, -0.5, 1.0);
        drawn->restitution[k] = uniform(seed, 0.0, 1.0);
    }
    drawn->train = (vi_orbit_train){.impacts = 1 + (int)choice(seed, IMPACTS),
                                    .periods = 1 + (int)choice(seed, 3),
                                    .contact = drawn->contact,
                                    .phase = drawn->phase};
    const double slot = TURN * drawn->train.periods / drawn->train.impacts;
    for (int i = 0; i < drawn->train.impacts; ++i) {
        drawn->contact[i] = (int32_t)choice(seed, (unsigned)body->contacts);
        drawn->phase[i] = slot * (i + uniform(seed, 0.0, 0.8));
    }
}

/* Let dashpots between random points couple the modes. */
static void couple(uint64_t *seed, orbit_case *drawn)
{
    vi_orbit_body *body = &drawn->body;
    const int modes = body->modes;
    for (int j = 0; j < modes * modes; ++j) {
        damping[j] = 0.0;
    }
    for (int dashpot = 0; dashpot < 1 + (int)choice(seed, MODES); ++dashpot) {
        double at[MODES];
        for (int j = 0; j < modes; ++j) {
            at[j] = uniform(seed, -1.0, 1.0);
        }
        for (int j = 0; j < modes * modes; ++j) {
            damping[j] += at[j / modes] * at[j % modes];
        }
    }
    for (int j = 0; j < modes; ++j) {
        drawn->damping_ratio[j] = damping[j * modes + j] / (2.0 * drawn->natural[j]);
    }
    if (choice(seed, 3) == 0) { /* next to critical damping of one mode, or at it */
        const double off[] = {0.0, 1e-12, 1e-9, 1e-6, 1e-3};
        for (int i = 1; i < modes; ++i) {
            damping[i] = damping[i * modes] = 0.0;
        }
        damping[0] = 2.0 * drawn->natural[0] * (1.0 + off[choice(seed, 5)]);
        drawn->damping_ratio[0] = damping[0] / (2.0 * drawn->natural[0]);
    }
    CHECK(vi_door_orbit_couple(modes, body->angular_frequency, body->natural, damping, body->cosine, body->sine,
                               &coupling, &work) == 0,
          "%d modes", modes);
    body->coupling = &coupling;
}

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

/* The same for modes that are coupled, by power series over short steps. */
static void fly_coupled(const vi_orbit_body *body, const double state[], double phase, double u, double end[])
{
    const int modes = body->modes, steps = 1 + (int)(u * 24.0);
    const double w = body->angular_frequency, h = u / steps;
    memcpy(end, state, (size_t)(2 * modes) * sizeof *end);
    for (int step = 0; step < steps; ++step) {
        double x[MODES], v[MODES], power = h, turned = 1.0; /* h^(n + 1), w^n / n! */
        memcpy(x, end, (size_t)modes * sizeof *x);
        memcpy(v, end + modes, (size_t)modes * sizeof *v);
        for (int n = 0; n < 30; ++n) {
            double force[MODES];
            const double angle = phase + w * h * step + 0.25 * TURN * n; /* each derivative turns by a quarter */
            for (int j = 0; j < modes; ++j) {
                force[j] = turned * (body->cosine[j] * cos(angle) + body->sine[j] * sin(angle))
                           + (n == 0 ? body->held[j] : 0.0);
            }
            next_coefficient(body, n, x, v, force);
            for (int j = 0; j < modes; ++j) {
                end[j] += x[j] * power;
                end[modes + j] += v[j] * power;
            }
            turned *= w / (n + 1.0);
            power *= h;
        }
    }
}

/* Fly all modes from `state` at `phase` for u seconds, on the core's exact flow. */
static void fly(const vi_orbit_body *body, const double state[], double phase, double u, double end[])
{
    if (body->coupling) {
        fly_coupled(body, state, phase, u, end);
        return;
    }
    for (int j = 0; j < body->modes; ++j) {
        const double natural = body->natural[j], c = body->cosine[j], s = body->sine[j];
        const double angle = phase - atan2(s, c);
        vi_mode mode;
        vi_mode_start(&mode, 1.0, 2.0 * body->damping_ratio[j] * natural, natural * natural, hypot(c, s),
                      body->angular_frequency);
        double x = state[j], v = state[body->modes + j];
        for (double done = 0.0; done < u;) { /* segments are short near a resonance */
            vi_segment segment;
            vi_motion motion;
            vi_segment_start(&segment, &mode, x, v, vi_phase_of(angle + body->angular_frequency * done), body->held[j],
                             0.0, u - done, false);
            vi_segment_at(&segment, segment.length, &motion);
            x = segment.origin + motion.x;
            v = motion.v;
            done = segment.length < u - done ? done + segment.length : u;
        }
        end[j] = x;
        end[body->modes + j] = v;
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
        const double beyond = at_contact(body, contact, end) - body->direction[contact] * body->position[contact];
        const double speed = at_contact(body, contact, end + modes);
        CHECK(fabs(beyond - distance[next]) <= close, "impact %d: %.17g, %.17g", next, beyond, distance[next]);
        CHECK(fabs(speed - velocity[next]) <= close, "impact %d: %.17g, %.17g", next, speed, velocity[next]);
        for (int j = 0; j < modes; ++j) {
            const double taken = (1.0 + body->restitution[contact]) * body->direction[contact] * speed
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
    const double beyond = at_contact(body, contact, end) - body->direction[contact] * body->position[contact];
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
            if (contact != drawn->contact[next] && at_contact(body, contact, end + body->modes) > 1e-9
                && at_contact(body, contact, after + body->modes) < -1e-9) {
                const double beyond = at_contact(body, contact, after)
                                      - body->direction[contact] * body->position[contact];
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
            double before[2 * MODES], now[2 * MODES], later[2 * MODES];
            for (int k = 1; k < SAMPLES; ++k) {
                fly(body, start, drawn->phase[i], length * (k - 1) / SAMPLES, before);
                fly(body, start, drawn->phase[i], length * k / SAMPLES, now);
                fly(body, start, drawn->phase[i], length * (k + 1) / SAMPLES, later);
                const double y = at_contact(body, contact, now);
                if (y >= at_contact(body, contact, before) && y >= at_contact(body, contact, later)) {
                    const double beyond = y - body->direction[contact] * body->position[contact];
                    CHECK(beyond <= what[0] + close, "contact %d: %.17g, %.17g", contact, beyond, what[0]);
                }
            }
        }
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
        bad.train.phase = bad.phase;                                                                                   \
        bad.train.contact = bad.contact;                                                                               \
        change;                                                                                                        \
        CHECK(end_of(&bad) == VI_ORBIT_REFUSED, "%s", #change);                                                        \
    } while (0)
    REFUSED(bad.body.modes = 0);
    REFUSED(bad.body.modes = VI_MODES + 1);
    REFUSED(bad.body.contacts = 0);
    REFUSED(bad.body.contacts = VI_PORTS + 1);
    REFUSED(bad.body.angular_frequency = 0.0);
    REFUSED(bad.body.angular_frequency = (double)NAN);
    REFUSED(bad.natural[0] = 0.0);
    REFUSED(bad.natural[0] = (double)INFINITY);
    REFUSED(bad.damping_ratio[0] = -0.1);
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
