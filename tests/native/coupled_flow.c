/* The coupled motion against a Runge-Kutta integration of the same equations in small steps. */
#include "body/modal/coupled_flow.h"

#include <math.h>
#include <string.h>

#include "check.h"

enum { MODES = 5, STEPS = 400 };

static vi_structure_model model;
static double held[VI_MODES], held_rate[VI_MODES];
static vi_press press[VI_PORTS];
static const double sign[VI_PORTS] = {1.0, -1.0};
static double start_at[VI_PORTS], start_q[VI_MODES], phase;

static void slope(double u, const double y[2 * MODES], double dy[2 * MODES])
{
    for (int j = 0; j < MODES; ++j) {
        dy[j] = y[MODES + j];
        dy[MODES + j] = model.mode[j].force * cos(phase + model.clock.angular_frequency * u) + held[j] + held_rate[j] * u
                        - model.mode[j].stiffness * y[j];
        for (int i = 0; i < MODES; ++i) {
            dy[MODES + j] -= model.coupled ? model.coupling[j][i] * y[MODES + i]
                                           : (i == j ? 2.0 * model.mode[j].decay * y[MODES + j] : 0.0);
        }
    }
    double b = 0.0, g = 0.0;
    for (int k = 0; k < model.contacts; ++k) {
        double d = start_at[k], rate = 0.0, force = 0.0;
        for (int j = 0; j < MODES; ++j) {
            d += sign[k] * model.shape[k][j] * (y[j] - start_q[j]);
            rate += sign[k] * model.shape[k][j] * y[MODES + j];
        }
        if (press[k].kind == VI_PRESS_LINEAR) {
            force = press[k].constant + press[k].stiffness * d + press[k].damping * rate;
        } else if (press[k].kind == VI_PRESS_POWER) {
            force = press[k].stiffness * pow(d, press[k].exponent) * (1.0 + press[k].damping * rate);
        }
        for (int j = 0; j < MODES; ++j) {
            dy[MODES + j] -= sign[k] * model.shape[k][j] * force;
        }
    }
    for (int j = 0; j < MODES && press[0].kind == VI_PRESS_HOLD; ++j) { /* contact 1 is held against all other forces */
        b += model.shape[0][j] * dy[MODES + j];
        g += model.shape[0][j] * model.shape[0][j];
    }
    for (int j = 0; j < MODES && g > 0.0; ++j) {
        dy[MODES + j] -= model.shape[0][j] * b / g;
    }
}

static void runge_kutta(double length, double y[2 * MODES])
{
    const double h = length / STEPS;
    double a[2 * MODES], b[2 * MODES], c[2 * MODES], d[2 * MODES], z[2 * MODES];
    for (int n = 0; n < STEPS; ++n) {
        const double u = (double)n * h;
        slope(u, y, a);
        for (int i = 0; i < 2 * MODES; ++i) {
            z[i] = y[i] + 0.5 * h * a[i];
        }
        slope(u + 0.5 * h, z, b);
        for (int i = 0; i < 2 * MODES; ++i) {
            z[i] = y[i] + 0.5 * h * b[i];
        }
        slope(u + 0.5 * h, z, c);
        for (int i = 0; i < 2 * MODES; ++i) {
            z[i] = y[i] + h * c[i];
        }
        slope(u + h, z, d);
        for (int i = 0; i < 2 * MODES; ++i) {
            y[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]);
        }
    }
}

static void make(uint64_t *seed, double p[VI_MODES])
{
    memset(&model, 0, sizeof model);
    memset(press, 0, sizeof press);
    model.modes = MODES;
    model.contacts = 2;
    model.tolerance = 1e-10;
    model.coupled = (int32_t)choice(seed, 2);
    const double w = uniform(seed, 0.1, 3.0);
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
        for (int i = 0; i <= j; ++i) {
            model.coupling[i][j] = model.coupling[j][i] = (i == j ? 1.0 : 0.2) * uniform(seed, 0.0, 1.0);
        }
    }
    phase = uniform(seed, -3.0, 3.0);
    for (int k = 0; k < 2; ++k) {
        const unsigned kind = choice(seed, 3);
        start_at[k] = uniform(seed, 0.5, 1.0);
        press[k] = kind == 0   ? (vi_press){.kind = VI_PRESS_NONE}
                   : kind == 1 ? (vi_press){VI_PRESS_LINEAR, uniform(seed, -1.0, 1.0), uniform(seed, 0.0, 50.0),
                                            uniform(seed, 0.0, 2.0), 1.0}
                               : (vi_press){VI_PRESS_POWER, 0.0, uniform(seed, 0.0, 50.0), uniform(seed, 0.0, 1.0),
                                            uniform(seed, 1.0, 2.5)};
    }
    if (choice(seed, 2) == 0) {
        double rate = 0.0, square = 0.0;
        press[0] = (vi_press){.kind = VI_PRESS_HOLD};
        start_at[0] = 0.0;
        for (int j = 0; j < MODES; ++j) {
            rate += model.shape[0][j] * p[j];
            square += model.shape[0][j] * model.shape[0][j];
        }
        for (int j = 0; j < MODES; ++j) {
            p[j] -= model.shape[0][j] * rate / square;
        }
    }
    vi_structure_prepare(&model);
}

int main(void)
{
    uint64_t seed = 4;
    static vi_drift drift;
    for (int run = 0; run < 1000; ++run) {
        double p[VI_MODES] = {0.0}, q_end[VI_MODES], p_end[VI_MODES], y[2 * MODES], before[VI_MODES];
        make(&seed, p);
        const vi_drive drive = {.phase = vi_phase_of(phase), .held = held, .held_rate = held_rate, .degree = 1};
        const vi_drift_start start = {start_q, p, drive, start_at, sign, press};
        vi_drift_begin(&drift, &model, &start, uniform(&seed, 0.01, 1.0));
        CHECK(drift.length > 1e-4, "run %d: a segment of %g s", run, drift.length);
        memcpy(before, start_q, sizeof before);
        memcpy(y, start_q, MODES * sizeof y[0]);
        memcpy(y + MODES, p, MODES * sizeof y[0]);
        const double u = drift.length * uniform(&seed, 0.2, 1.0);
        vi_drift_at(&drift, u, before, p_end, q_end);
        runge_kutta(u, y);
        for (int j = 0; j < MODES; ++j) {
            /* Runge-Kutta errs by (rate h)^4, rate u < 1: some 1e-11 in 400 steps; power laws err by their tolerance */
            CHECK(fabs(q_end[j] - y[j]) <= 1e-9 && fabs(p_end[j] - y[MODES + j]) <= 2e-9 * (1.0 + 1.0 / u),
                  "run %d: mode %d: %.17g, %.17g and %.17g, %.17g", run, j, q_end[j], p_end[j], y[j], y[MODES + j]);
        }
    }
    return 0;
}
