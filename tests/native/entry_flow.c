/* The entry into a power law against a Runge-Kutta integration over the square root of time. */
#include "body/modal/entry_flow.h"

#include <math.h>
#include <string.h>

#include "check.h"

enum { MODES = 5, STEPS = 400 };

static vi_structure_model model;
static double held[VI_MODES], held_rate[VI_MODES];
static vi_press press[VI_PORTS];
static const double sign[VI_PORTS] = {-1.0, 1.0}, start_at[VI_PORTS] = {0.0, -0.7};
static double start_q[VI_MODES], phase;

/* Slopes over r, with time r^2; y: displacements, velocities, impulse of the contact. */
static void slope(double r, const double y[2 * MODES + 1], double dy[2 * MODES + 1])
{
    const double u = r * r;
    double d = 0.0, rate = 0.0;
    for (int j = 0; j < MODES; ++j) {
        d += sign[0] * model.shape[0][j] * (y[j] - start_q[j]);
        rate += sign[0] * model.shape[0][j] * y[MODES + j];
    }
    const double force = press[0].stiffness * pow(fmax(0.0, d), press[0].exponent) * (1.0 + press[0].damping * rate);
    for (int j = 0; j < MODES; ++j) {
        const vi_mode *mode = &model.mode[j];
        const double load = mode->force * cos(phase + model.clock.angular_frequency * u) + held[j] + held_rate[j] * u;
        dy[j] = 2.0 * r * y[MODES + j];
        dy[MODES + j] = 2.0 * r * (load - mode->stiffness * y[j] - 2.0 * mode->decay * y[MODES + j]
                                   - sign[0] * model.shape[0][j] * force);
    }
    dy[2 * MODES] = 2.0 * r * force;
}

static void runge_kutta(double length, double y[2 * MODES + 1])
{
    enum { SIZE = 2 * MODES + 1 };
    const double h = length / STEPS;
    double a[SIZE], b[SIZE], c[SIZE], d[SIZE], z[SIZE];
    for (int n = 0; n < STEPS; ++n) {
        const double r = (double)n * h;
        slope(r, y, a);
        for (int i = 0; i < SIZE; ++i) {
            z[i] = y[i] + 0.5 * h * a[i];
        }
        slope(r + 0.5 * h, z, b);
        for (int i = 0; i < SIZE; ++i) {
            z[i] = y[i] + 0.5 * h * b[i];
        }
        slope(r + 0.5 * h, z, c);
        for (int i = 0; i < SIZE; ++i) {
            z[i] = y[i] + h * c[i];
        }
        slope(r + h, z, d);
        for (int i = 0; i < SIZE; ++i) {
            y[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
        }
    }
}

/* Make a body that moves into its first contact, and away from its second. */
static void make(uint64_t *seed, double p[VI_MODES])
{
    const double w = uniform(seed, 0.1, 3.0);
    double rate = 0.0;
    memset(&model, 0, sizeof model);
    model.modes = MODES;
    model.contacts = 2;
    model.tolerance = 1e-10;
    CHECK(vi_clock_start(&model.clock, w, 0.0, 1.0), "%s", "clock");
    for (int j = 0; j < MODES; ++j) {
        vi_structure_mode(&model, j, (double)j + uniform(seed, 0.3, 1.0), uniform(seed, 0.0, 1.5), uniform(seed, -1.0, 1.0), w);
        start_q[j] = uniform(seed, -1.0, 1.0);
        p[j] = uniform(seed, -1.0, 1.0);
        held[j] = uniform(seed, -1.0, 1.0);
        held_rate[j] = uniform(seed, -1.0, 1.0);
        for (int k = 0; k < 2; ++k) {
            model.shape[k][j] = model.impulse[k][j] = uniform(seed, -1.0, 1.0);
        }
        rate += sign[0] * model.shape[0][j] * p[j];
    }
    for (int j = 0; j < MODES && rate < 0.0; ++j) {
        p[j] = -p[j];
    }
    phase = uniform(seed, -3.0, 3.0);
    press[1] = (vi_press){.kind = VI_PRESS_NONE};
    press[0] = (vi_press){VI_PRESS_POWER, 0.0, pow(10.0, uniform(seed, 0.0, 4.0)),
                          choice(seed, 2) == 0 ? 0.0 : uniform(seed, 0.0, 1.0), 1.0 + 0.5 * (double)choice(seed, 4)};
    vi_structure_prepare(&model);
}

/* Do the terms prove that the first contact stays pressed up to r? */
static bool stays_pressed(const vi_drift *drift, double r)
{
    double inward[VI_ORDER + 1] = {0.0};
    memcpy(inward, &drift->penetration[0][2], (VI_ORDER - 1) * sizeof inward[0]);
    return vi_polynomial_clears(inward, r);
}

int main(void)
{
    uint64_t seed = 4;
    static vi_drift drift;
    int checked = 0;
    for (int run = 0; run < 500; ++run) {
        double p[VI_MODES] = {0.0}, q_end[VI_MODES], p_end[VI_MODES], y[2 * MODES + 1], depth[4];
        make(&seed, p);
        const vi_drive drive = {.phase = vi_phase_of(phase), .held = held, .held_rate = held_rate, .degree = 1};
        const vi_drift_start start = {start_q, p, drive, start_at, sign, press};
        CHECK(vi_entry_begin(&drift, &model, &start, 0, uniform(&seed, 0.01, 1.0)), "run %d", run);
        memset(y, 0, sizeof y);
        memcpy(y, start_q, MODES * sizeof y[0]);
        memcpy(y + MODES, p, MODES * sizeof y[0]);
        const double r = sqrt(drift.length) * uniform(&seed, 0.2, 1.0), u = r * r;
        if (!stays_pressed(&drift, r)) {
            continue;
        }
        ++checked;
        vi_drift_at(&drift, u, start_q, p_end, q_end);
        runge_kutta(r, y);
        double moved = -0.7;
        for (int j = 0; j < MODES; ++j) {
            CHECK(fabs(q_end[j] - y[j]) <= 1e-9 && fabs(p_end[j] - y[MODES + j]) <= 1e-8,
                  "run %d: mode %d: %.17g, %.17g and %.17g, %.17g", run, j, q_end[j], p_end[j], y[j], y[MODES + j]);
            moved += model.shape[1][j] * (y[j] - start_q[j]);
        }
        const double impulse = vi_drift_impulse(&drift, 0, u);
        CHECK(fabs(impulse - y[2 * MODES]) <= 1e-8 * (1.0 + y[2 * MODES]), "run %d: %.17g and %.17g N s", run, impulse,
              y[2 * MODES]);
        vi_polynomial_at(drift.penetration[1], r, depth);
        CHECK(fabs(depth[0] - moved) <= 1e-8, "run %d: the other contact at %.17g, not %.17g", run, depth[0], moved);
    }
    CHECK(checked > 300, "only %d entries", checked);
    press[0].exponent = 1.3;
    double p[VI_MODES] = {1.0};
    const vi_drive drive = {.phase = vi_phase_of(0.0), .held = held, .held_rate = held_rate, .degree = 1};
    const vi_drift_start start = {start_q, p, drive, start_at, sign, press};
    CHECK(!vi_entry_begin(&drift, &model, &start, 0, 1.0), "%s", "d^1.3 has no such series");
    return 0;
}
