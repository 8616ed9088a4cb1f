/* Periodic orbits of random bodies: determinant of the monodromy matrix, slopes, refusals. */
#include "door/orbits.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "check.h"
#include "door/orbit_maximum.h"

static const double TURN = 6.283185307179586;

enum { HARMONICS = 3, CONTACTS = 8 };

typedef struct {
    double natural[VI_MODES], damping_ratio[VI_MODES], held[VI_MODES];
    double order[HARMONICS], cosine[HARMONICS * VI_MODES], sine[HARMONICS * VI_MODES];
    double stop_cosine[HARMONICS * CONTACTS], stop_sine[HARMONICS * CONTACTS];
    double shape[CONTACTS * VI_MODES], impulse[CONTACTS * VI_MODES];
    double direction[CONTACTS], position[CONTACTS], restitution[CONTACTS], yield_velocity[CONTACTS];
    double phase[VI_ORBIT_IMPACTS];
    int32_t contact[VI_ORBIT_IMPACTS];
    vi_orbit_body body;
    vi_orbit_train train;
    double damping[VI_MODES * VI_MODES];
    vi_orbit_coupling coupling;
    vi_coupled_work work;
} sample;

static void draw(sample *s, uint64_t *seed, int most_modes)
{
    const int modes = 1 + (int)choice(seed, (unsigned)most_modes), contacts = 1 + (int)choice(seed, CONTACTS);
    for (int j = 0; j < modes; ++j) {
        s->natural[j] = pow(10.0, uniform(seed, -1.0, 1.5));
        s->damping_ratio[j] = choice(seed, 4) ? uniform(seed, 0.0, 0.2) : uniform(seed, 0.9, 3.0);
        s->held[j] = uniform(seed, -0.1, 0.1);
    }
    const int harmonics = 1 + (int)choice(seed, HARMONICS);
    for (int k = 0; k < harmonics; ++k) {
        s->order[k] = (k > 0 ? s->order[k - 1] : 0.0) + 1.0 + choice(seed, 3);
        for (int j = 0; j < modes; ++j) {
            s->cosine[k * modes + j] = uniform(seed, -1.0, 1.0);
            s->sine[k * modes + j] = uniform(seed, -1.0, 1.0);
        }
        for (int contact = 0; contact < contacts; ++contact) {
            s->stop_cosine[k * contacts + contact] = uniform(seed, -0.2, 0.2);
            s->stop_sine[k * contacts + contact] = uniform(seed, -0.2, 0.2);
        }
    }
    for (int k = 0; k < contacts; ++k) {
        double square = 0.0;
        for (int j = 0; j < modes; ++j) {
            s->shape[k * modes + j] = uniform(seed, -1.0, 1.0);
            square += s->shape[k * modes + j] * s->shape[k * modes + j];
        }
        for (int j = 0; j < modes; ++j) {
            s->impulse[k * modes + j] = s->shape[k * modes + j] / square;
        }
        s->direction[k] = choice(seed, 2) ? 1.0 : -1.0;
        s->position[k] = uniform(seed, -1.0, 1.0);
        s->restitution[k] = uniform(seed, 0.1, 1.0);
        s->yield_velocity[k] = choice(seed, 2) ? uniform(seed, 0.01, 0.5) : 0.0;
    }
    s->train = (vi_orbit_train){.impacts = 1 + (int)choice(seed, 5), .periods = 1 + (int)choice(seed, 3)};
    double phase = uniform(seed, 0.0, 1.0);
    for (int i = 0; i < s->train.impacts; ++i) {
        s->phase[i] = phase;
        s->contact[i] = (int32_t)choice(seed, (unsigned)contacts);
        phase += uniform(seed, 0.1, 1.0) * (TURN - 2.0) / s->train.impacts;
    }
    s->train.phase = s->phase;
    s->train.contact = s->contact;
    s->body = (vi_orbit_body){.modes = modes,
                              .contacts = contacts,
                              .harmonics = harmonics,
                              .angular_frequency = uniform(seed, 0.3, 3.0),
                              .order = s->order,
                              .natural = s->natural,
                              .damping_ratio = s->damping_ratio,
                              .cosine = s->cosine,
                              .sine = s->sine,
                              .held = s->held,
                              .shape = s->shape,
                              .impulse = s->impulse,
                              .direction = s->direction,
                              .position = s->position,
                              .stop_cosine = s->stop_cosine,
                              .stop_sine = s->stop_sine,
                              .restitution = s->restitution,
                              .yield_velocity = s->yield_velocity};
}

/* Find the complex modes; returns the result of the call. */
static int find_coupling(sample *s)
{
    double rate[HARMONICS];
    for (int k = 0; k < s->body.harmonics; ++k) {
        rate[k] = s->order[k] * s->body.angular_frequency;
    }
    return vi_door_orbit_couple(s->body.modes, s->body.harmonics, rate, s->natural, s->damping, s->cosine, s->sine,
                                &s->coupling, &s->work);
}

/* Let dashpots between random points couple the modes. */
static void couple(sample *s, uint64_t *seed)
{
    const int modes = s->body.modes, dashpots = 1 + (int)choice(seed, 8);
    memset(s->damping, 0, sizeof s->damping);
    for (int dashpot = 0; dashpot < dashpots; ++dashpot) {
        double at[VI_MODES];
        for (int j = 0; j < modes; ++j) {
            at[j] = uniform(seed, -0.3, 0.3);
        }
        for (int j = 0; j < modes * modes; ++j) {
            s->damping[j] += at[j / modes] * at[j % modes];
        }
    }
    for (int j = 0; j < modes; ++j) {
        s->damping_ratio[j] = s->damping[j * modes + j] / (2.0 * s->natural[j]);
    }
    CHECK(find_coupling(s) == 0, "%d modes", modes);
    s->body.coupling = &s->coupling;
}

/* Determinant by elimination; the matrix is overwritten. */
static double determinant(int n, double a[])
{
    double product = 1.0;
    for (int k = 0; k < n; ++k) {
        int pivot = k;
        for (int i = k + 1; i < n; ++i) {
            pivot = fabs(a[i * n + k]) > fabs(a[pivot * n + k]) ? i : pivot;
        }
        for (int j = 0; pivot != k && j < n; ++j) {
            const double kept = a[k * n + j];
            a[k * n + j] = a[pivot * n + j];
            a[pivot * n + j] = kept;
        }
        product *= pivot == k ? a[k * n + k] : -a[k * n + k];
        for (int i = k + 1; i < n && a[k * n + k] != 0.0; ++i) {
            const double share = a[i * n + k] / a[k * n + k];
            for (int j = k; j < n; ++j) {
                a[i * n + j] -= share * a[k * n + j];
            }
        }
    }
    return product;
}

/* Hadamard's bound: the product of the lengths of the rows. */
static double determinant_bound(int n, const double a[])
{
    double product = 1.0;
    for (int i = 0; i < n; ++i) {
        double square = 0.0;
        for (int j = 0; j < n; ++j) {
            square += a[i * n + j] * a[i * n + j];
        }
        product *= sqrt(square);
    }
    return product;
}

static void check_body(uint64_t *seed, int most_modes, bool invariants, bool coupled)
{
    static sample s;
    static double state[VI_ORBIT_IMPACTS * VI_ORBIT_STATES], monodromy[VI_ORBIT_STATES * VI_ORBIT_STATES];
    double velocity[VI_ORBIT_IMPACTS], distance[VI_ORBIT_IMPACTS];
    double slope[VI_ORBIT_IMPACTS * VI_ORBIT_IMPACTS], faster[VI_ORBIT_IMPACTS * VI_ORBIT_IMPACTS];
    draw(&s, seed, most_modes);
    if (coupled) {
        couple(&s, seed);
    } else if (choice(seed, 2)) {
        s.natural[0] = s.damping_ratio[0] = 0.0;
    }
    const int end = vi_door_orbit(&s.body, &s.train, velocity, distance, slope, faster);
    CHECK(end == VI_ORBIT_DONE || end == VI_ORBIT_SINGULAR || end == VI_ORBIT_RESONANT || end == VI_ORBIT_ADRIFT,
          "end %d", end);
    if (end != VI_ORBIT_DONE) {
        return;
    }
    CHECK(vi_door_orbit_motion(&s.body, &s.train, velocity, state, monodromy) == VI_ORBIT_DONE, "no motion");
    double what[3];
    CHECK(vi_door_orbit_maximum(&s.body, &s.train, state, what) == VI_ORBIT_DONE, "no maximum");
    const int modes = s.body.modes;
    double expected = 0.0, slowest = HUGE_VAL;
    for (int i = 0; i < s.train.impacts; ++i) {
        /* r (r + r' V): above the yield velocity r falls as V^(-1/4) */
        const double yield = s.yield_velocity[s.contact[i]];
        const bool falls = yield > 0.0 && velocity[i] > yield;
        const double r = s.restitution[s.contact[i]] * (falls ? pow(velocity[i] / yield, -0.25) : 1.0);
        expected += log(r * (falls ? 0.75 : 1.0) * r);
        slowest = fmin(slowest, fabs(velocity[i]));
        /* after an impact the contact moves away at restitution times the speed before */
        double speed = 0.0;
        for (int j = 0; j < modes; ++j) {
            speed += s.shape[s.contact[i] * modes + j] * state[i * 2 * modes + modes + j];
        }
        for (int k = 0; k < s.body.harmonics; ++k) {
            const double w = s.order[k] * s.body.angular_frequency, angle = s.order[k] * s.phase[i];
            const int of = k * s.body.contacts + s.contact[i];
            speed -= w * (s.stop_sine[of] * cos(angle) - s.stop_cosine[of] * sin(angle));
        }
        const double left = -s.direction[s.contact[i]] * speed, came = r * velocity[i];
        CHECK(fabs(left - came) <= 1e-9 * (1.0 + fabs(velocity[i])), "impact %d: %.17g, not %.17g", i, left, came);
    }
    for (int j = 0; j < modes; ++j) {
        expected -= 2.0 * s.damping_ratio[j] * s.natural[j] * TURN * s.train.periods / s.body.angular_frequency;
    }
    if (invariants && expected > -12.0 && slowest > 1e-3) {
        const double exact = exp(expected), size = determinant_bound(2 * modes, monodromy);
        const double found = determinant(2 * modes, monodromy);
        CHECK(fabs(found - exact) <= 1e-6 * exact + 1e-13 * size, "%d modes: determinant %.17g, not %.17g", modes,
              found, exact);
    }
}

static void check_refusals(uint64_t *seed)
{
    static sample s;
    double velocity[VI_ORBIT_IMPACTS], distance[VI_ORBIT_IMPACTS], slope[25], faster[25];
    draw(&s, seed, 3);
    s.natural[0] = 0.0;
    s.damping_ratio[0] = 0.1;
    CHECK(vi_door_orbit(&s.body, &s.train, velocity, distance, slope, faster) == VI_ORBIT_REFUSED, "a dragged mode");
    do {
        draw(&s, seed, 3);
    } while (s.body.modes < 2);
    s.natural[1] = s.damping_ratio[1] = 0.0;
    CHECK(vi_door_orbit(&s.body, &s.train, velocity, distance, slope, faster) == VI_ORBIT_REFUSED, "a late loose mode");
    s.natural[0] = s.damping_ratio[0] = 0.0;
    s.train.impacts = 1;
    CHECK(vi_door_orbit(&s.body, &s.train, velocity, distance, slope, faster) == VI_ORBIT_ADRIFT, "a mode adrift");
    draw(&s, seed, 3);
    s.contact[0] = (int32_t)VI_ORBIT_CONTACTS;
    CHECK(vi_door_orbit(&s.body, &s.train, velocity, distance, slope, faster) == VI_ORBIT_REFUSED, "no contact");
    draw(&s, seed, 3);
    s.phase[0] = NAN;
    CHECK(vi_door_orbit(&s.body, &s.train, velocity, distance, slope, faster) == VI_ORBIT_REFUSED, "no phase");
    draw(&s, seed, 3);
    s.train.impacts = VI_ORBIT_IMPACTS + 1;
    CHECK(vi_door_orbit(&s.body, &s.train, velocity, distance, slope, faster) == VI_ORBIT_REFUSED, "impacts");
    draw(&s, seed, 1);
    s.damping_ratio[0] = 0.0;
    s.natural[0] = s.body.angular_frequency = 1.0;
    s.order[0] = 1.0;
    CHECK(vi_door_orbit(&s.body, &s.train, velocity, distance, slope, faster) == VI_ORBIT_RESONANT, "resonance");
}

static void check_coupled_refusals(uint64_t *seed)
{
    static sample s;
    double velocity[VI_ORBIT_IMPACTS], distance[VI_ORBIT_IMPACTS], slope[25], faster[25];
    do {
        draw(&s, seed, 3);
    } while (s.body.modes < 2);
    couple(&s, seed);
    s.damping[1] = NAN;
    CHECK(find_coupling(&s) == 1, "no damping");
    memset(s.damping, 0, sizeof s.damping);
    s.natural[0] = s.body.angular_frequency = s.order[0] = 1.0;
    s.body.harmonics = 1;
    for (int j = 0; j < s.body.modes; ++j) {
        s.damping[j * s.body.modes + j] = j == 0 ? 2.0 : 0.1;
    }
    CHECK(find_coupling(&s) == 0, "critical damping");
    CHECK(vi_door_orbit(&s.body, &s.train, velocity, distance, slope, faster) == VI_ORBIT_DONE, "critical damping");
    s.coupling.fastest = 1e6;
    CHECK(vi_door_orbit(&s.body, &s.train, velocity, distance, slope, faster) == VI_ORBIT_CRITICAL, "too many steps");
    s.damping[0] = 0.0;
    CHECK(find_coupling(&s) == 0, "no damping");
    CHECK(vi_door_orbit(&s.body, &s.train, velocity, distance, slope, faster) == VI_ORBIT_RESONANT, "resonance");
}

int main(void)
{
    uint64_t seed = 7;
    for (int i = 0; i < 3000; ++i) {
        check_body(&seed, 4, true, i % 2 == 1);
    }
    for (int i = 0; i < 20; ++i) {
        check_body(&seed, VI_MODES, false, i % 4 == 3);
    }
    check_refusals(&seed);
    check_coupled_refusals(&seed);
    return 0;
}
