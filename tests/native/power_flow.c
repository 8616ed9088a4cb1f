/* Responses of modes to polynomial forces against quadrature; steps of a contact against the series. */
#include "body/modal/power_flow.h"

#include <math.h>
#include <string.h>

#include "check.h"
#include "motion/moments.h"

enum { MODES = 6, LEVEL = 5 };

/* ---- moments ---- */

static const double NODE[4] = {0.18343464249564980494, 0.52553240991632898582, 0.79666647741362673959,
                               0.96028985649753623168};
static const double WEIGHT[4] = {0.36268378337836198297, 0.31370664587788728734, 0.22238103445337447054,
                                 0.10122853629037625915};

/* Responses by Gauss quadrature with eight points over pieces of at most half a radian. */
static void integrate(const vi_mode *mode, double length, double x[VI_NODES], double v[VI_NODES])
{
    const int pieces = 16 + (int)(2.0 * mode->natural * length);
    memset(x, 0, VI_NODES * sizeof x[0]);
    memset(v, 0, VI_NODES * sizeof v[0]);
    for (int i = 0; i < 8 * pieces; ++i) {
        const double node = (i % 8 < 4 ? 1.0 : -1.0) * NODE[i % 4], piece = length / pieces;
        const double s = piece * ((double)(i / 8) + 0.5 * (1.0 + node)), z = 2.0 * s / length - 1.0;
        double phi[4], before = 1.0, p = z;
        vi_mode_propagator(mode, length - s, phi);
        for (int n = 0; n < VI_NODES; ++n) {
            const double share = 0.5 * piece * WEIGHT[i % 4] * (n == 0 ? 1.0 : p);
            x[n] += share * phi[1];
            v[n] += share * phi[3];
            if (n > 0) {
                const double next = ((2.0 * n + 1.0) * z * p - n * before) / (n + 1.0);
                before = p;
                p = next;
            }
        }
    }
}

static void check_moments(uint64_t *seed)
{
    for (int run = 0; run < 400; ++run) {
        vi_mode mode;
        double x[VI_NODES], v[VI_NODES], right_x[VI_NODES], right_v[VI_NODES];
        const double natural = choice(seed, 10) == 0 ? 0.0 : pow(10.0, uniform(seed, -2.0, 3.0));
        const double ratio = choice(seed, 3) == 0 ? 0.0 : uniform(seed, 0.0, 0.99);
        const double length = natural > 0.0 ? pow(10.0, uniform(seed, -3.0, 3.0)) / natural : uniform(seed, 0.1, 2.0);
        vi_mode_start(&mode, 1.0, 2.0 * ratio * natural, natural * natural, 0.0, 0.0);
        CHECK(vi_moments_exist(&mode), "run %d: damping ratio %g", run, ratio);
        vi_moments(&mode, length, x, v);
        integrate(&mode, length, right_x, right_v);
        double most_x = 0.0, most_v = 0.0;
        for (int n = 0; n < VI_NODES; ++n) {
            most_x = fmax(most_x, fabs(right_x[n]));
            most_v = fmax(most_v, fabs(right_v[n]));
        }
        for (int n = 0; n < VI_NODES; ++n) {
            CHECK(fabs(x[n] - right_x[n]) <= 1e-11 * most_x && fabs(v[n] - right_v[n]) <= 1e-11 * most_v,
                  "run %d, P_%d, natural %g, ratio %g, length %g: %.17g, %.17g and %.17g, %.17g", run, n, natural,
                  ratio, length, x[n], v[n], right_x[n], right_v[n]);
        }
    }
    vi_mode stiff;
    vi_mode_start(&stiff, 1.0, 2.0, 1.0, 0.0, 0.0);
    CHECK(!vi_moments_exist(&stiff), "%s", "critical damping has no such form");
}

/* ---- series over a step ---- */

static void check_series(uint64_t *seed)
{
    static vi_legendre basis;
    vi_legendre_prepare(&basis);
    for (int run = 0; run < 200; ++run) {
        const double rate = uniform(seed, 0.5, 4.0), turn = uniform(seed, -3.0, 3.0);
        double value[VI_NODES], series[VI_NODES], at[2], largest = -HUGE_VAL;
        for (int i = 0; i < VI_NODES; ++i) {
            value[i] = cos(turn + rate * (2.0 * basis.node[i] - 1.0));
        }
        vi_legendre_series(&basis, value, series);
        for (int i = 0; i <= 100; ++i) {
            const double x = 0.02 * i - 1.0;
            vi_legendre_at(series, x, at);
            CHECK(fabs(at[0] - cos(turn + rate * x)) <= 1e-7 && fabs(at[1] + rate * sin(turn + rate * x)) <= 1e-5,
                  "run %d: %.17g, %.17g", run, at[0], at[1]);
            largest = fmax(largest, at[0]);
        }
        const double found = vi_legendre_largest(&basis, series, value, 1.0, -2.0);
        CHECK(found >= largest - 1e-12 && found <= largest + 2e-3, "run %d: %.17g, not %.17g", run, found, largest);
        CHECK(found <= series[0] + vi_legendre_spread(series) + 1e-12, "run %d: %.17g", run, found);
        CHECK(vi_legendre_largest(&basis, series, value, 1.0, 5.0) == 5.0, "%s", "a larger value stays");
    }
}

/* ---- steps ---- */

static vi_structure_model model;
static vi_power_tables tables;
static double held[VI_MODES], held_rate[VI_MODES], q[VI_MODES], p[VI_MODES], at[VI_PORTS];
static vi_press press[VI_PORTS];
static const double sign[VI_PORTS] = {-1.0};

/* Make a body that is pressed in by its contact, and its forcing phase. */
static double make(uint64_t *seed)
{
    const double w = choice(seed, 4) == 0 ? 0.0 : uniform(seed, 0.1, 3.0);
    memset(&model, 0, sizeof model);
    model.modes = MODES;
    model.contacts = 1;
    model.tolerance = 1e-10;
    CHECK(vi_clock_start(&model.clock, w, 0.0, 1.0), "%s", "clock");
    for (int j = 0; j < MODES; ++j) {
        const double ratio = choice(seed, 3) == 0 ? 0.0 : uniform(seed, 0.0, 0.9);
        vi_structure_mode(&model, j, j == 0 && choice(seed, 3) == 0 ? 0.0 : pow(3.0, j) * uniform(seed, 0.3, 1.0),
                          ratio, uniform(seed, -1.0, 1.0), w);
        q[j] = uniform(seed, -1.0, 1.0) / pow(3.0, j);
        p[j] = uniform(seed, -1.0, 1.0);
        held[j] = uniform(seed, -1.0, 1.0);
        held_rate[j] = choice(seed, 2) == 0 ? 0.0 : uniform(seed, -1.0, 1.0);
        model.shape[0][j] = model.impulse[0][j] = uniform(seed, -1.0, 1.0);
        model.observed[j] = uniform(seed, -1.0, 1.0);
    }
    press[0] = (vi_press){VI_PRESS_POWER, 0.0, pow(10.0, uniform(seed, -1.0, 2.0)),
                          choice(seed, 2) == 0 ? 0.0 : uniform(seed, 0.0, 0.3), uniform(seed, 1.0, 2.5)};
    if (choice(seed, 2) == 0) {
        press[0].exponent = 1.5;
    }
    model.press[0] = press[0];
    at[0] = pow(10.0, uniform(seed, -1.0, 0.5));
    vi_structure_prepare(&model);
    return uniform(seed, -3.0, 3.0);
}

/* Follow the series for `length` seconds from the start; returns the impulse. */
static double by_series(double phase, double length, double q_end[VI_MODES], double p_end[VI_MODES])
{
    static vi_drift drift;
    double impulse = 0.0, load[VI_MODES], depth[VI_PORTS] = {at[0]};
    memcpy(q_end, q, sizeof q);
    memcpy(p_end, p, sizeof p);
    for (double u = 0.0, part; u < length; u += part) {
        const double angle = phase + model.clock.angular_frequency * u;
        double q_next[VI_MODES], p_next[VI_MODES];
        for (int j = 0; j < MODES; ++j) {
            load[j] = held[j] + held_rate[j] * u;
        }
        const vi_drive drive = {.phase = vi_phase_of(angle), .held = load, .held_rate = held_rate, .degree = 1};
        const vi_drift_start start = {q_end, p_end, drive, depth, sign, press};
        vi_drift_begin(&drift, &model, &start, 2.0 * (length - u));
        part = 0.5 * drift.length < length - u ? 0.5 * drift.length : length - u;
        impulse += vi_drift_impulse(&drift, 0, part);
        vi_drift_at(&drift, part, q_end, p_next, q_next);
        for (int j = 0; j < MODES; ++j) {
            depth[0] += sign[0] * model.shape[0][j] * (q_next[j] - q_end[j]);
        }
        memcpy(q_end, q_next, sizeof q_next);
        memcpy(p_end, p_next, sizeof p_next);
    }
    return impulse;
}

static double observed(const double modal[VI_MODES])
{
    return vi_structure_at(&model, model.observed, modal);
}

static void check_steps(uint64_t *seed)
{
    int checked = 0;
    for (int run = 0; run < 300; ++run) {
        const double phase = make(seed);
        CHECK(vi_power_tables_fit(&tables, &model), "run %d", run);
        const vi_power_level *level = vi_power_level_of(&tables, &model, (int)choice(seed, LEVEL + 1));
        const vi_drive drive = {.phase = vi_phase_of(phase), .held = held, .held_rate = held_rate, .degree = 1};
        const vi_drift_start state = {q, p, drive, at, sign, press};
        vi_power_start start;
        vi_power_course course[VI_PORTS];
        const int port[1] = {0};
        double q_end[VI_MODES], p_end[VI_MODES], right_q[VI_MODES], right_p[VI_MODES], moved[VI_NODES];
        vi_power_begin(&start, &model, &tables, &state, 0.0, 1, port, at);
        const bool solved = vi_power_solve(&start, level, course);
        const double *series = course[0].force_series;
        if (!solved || !(fabs(series[VI_NODES - 1]) + fabs(series[VI_NODES - 2]) <= 1e-13 * fabs(series[0]))) {
            continue; /* the contact ends, or the step is too long */
        }
        ++checked;
        vi_power_observe(&start, level, course, moved);
        memcpy(q_end, q, sizeof q);
        memcpy(p_end, p, sizeof p);
        vi_power_end(&start, level, course, q_end, p_end);
        const double impulse = by_series(phase, level->step, right_q, right_p);
        for (int j = 0; j < MODES; ++j) {
            CHECK(fabs(q_end[j] - right_q[j]) <= 1e-11 * (1.0 + impulse)
                      && fabs(p_end[j] - right_p[j]) <= 1e-11 * (1.0 + impulse),
                  "run %d: mode %d: %.17g, %.17g and %.17g, %.17g", run, j, q_end[j], p_end[j], right_q[j], right_p[j]);
        }
        CHECK(fabs(level->step * series[0] - impulse) <= 1e-11 * (1.0 + impulse), "run %d: %.17g and %.17g N s", run,
              level->step * series[0], impulse);
        const int i = (int)choice(seed, VI_NODES);
        by_series(phase, level->step * tables.basis.node[i], right_q, right_p);
        CHECK(fabs(moved[i] - (observed(right_q) - observed(q))) <= 1e-11 * (1.0 + impulse), "run %d: node %d: %.17g",
              run, i, moved[i]);
    }
    CHECK(checked > 100, "only %d steps", checked);
    vi_structure_mode(&model, MODES - 1, model.mode[MODES - 1].natural, 1.5, 0.0, model.clock.angular_frequency);
    CHECK(!vi_power_tables_fit(&tables, &model), "%s", "an overdamped mode has no such steps");
}

int main(void)
{
    uint64_t seed = 11;
    check_moments(&seed);
    check_series(&seed);
    check_steps(&seed);
    return 0;
}
