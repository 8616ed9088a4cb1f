#include "body/modal/structure/variational_flow.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "body/modal/carry.h"
#include "body/modal/forces.h"
#include "body/modal/structure/parameter.h"
#include "motion/majorant.h"

/* Relative error of a step of the integration. */
static const double TOLERANCE = 2e-14;
/* First step, in radians of the fastest rate; shortest one, relative to the segment, which any error passes. */
static const double FIRST = 3.0, SHORTEST = 1e-11;
/* Factors of the next step, after success with few columns and after failure. Each failure also allows a larger error of
 * the short step: the end of a force has no derivatives, and rounding does not shrink. */
static const double LONGER = 1.7, SHORTER = 0.4, LOOSER = 1.6;
/* Relative error up to which the end of a step tells the size of what follows. */
static const double ROUGHLY = 1e-3;
/* Rounding of an acceleration, relative to its terms. */
static const double ROUNDING = 64.0 * DBL_EPSILON;
/* Part of a size that the next step takes over. */
static const double REMEMBERED = 0.5;

/* Steps of the midpoint rule in each column of the extrapolation. With most columns its order is 18. */
enum { COLUMNS = 9, EASY = 7, LEAST = 3 };
static const int STEPS[COLUMNS] = {2, 4, 6, 8, 10, 12, 14, 16, 18};

/* Rows of a point: displacements and velocities of the motion, then of its derivative. */
enum { MOTION = 0, CHANGE = 2, ROWS = 4 };
typedef double point[ROWS][VI_MODES];

/* ---- closed form ---- */

/* Does the parameter change the harmonic force alone? */
VI_RARE static bool is_load(const vi_parameter *parameter)
{
    return parameter->mass == 0.0 && parameter->damping == 0.0 && parameter->stiffness == 0.0
           && parameter->frequency == 0.0;
}

VI_RARE static bool is_flight(const vi_structure *s)
{
    for (int k = 0; k < s->model->contacts; ++k) {
        const int32_t status = s->state->status[k];
        if (status == VI_CONTACT_HELD || status == VI_CONTACT_YIELDING) {
            return false;
        }
    }
    return !s->model->coupled;
}

/* The derivative of a mode is a motion of the same mode, under this force at this phase. */
VI_RARE static void fly_mode(const vi_mode *mode, double force, vi_phase phase, double u, double *x, double *v)
{
    const double w = mode->angular_frequency;
    if (force == 0.0) {
        double phi[4];
        vi_mode_propagator(mode, u, phi);
        const double moved = phi[0] * *x + phi[1] * *v;
        *v = phi[2] * *x + phi[3] * *v;
        *x = moved;
        return;
    }
    vi_mode driven = *mode;
    driven.sines = 0;
    vi_mode_drive(&driven, force, w);
    for (double gone = 0.0; gone < u;) {
        vi_segment segment;
        vi_segment_start(&segment, &driven, *x, *v, phase, 0.0, 0.0, u - gone, false);
        const double length = vi_min(segment.length, u - gone);
        phase = vi_phase_of(phase.angle + w * length);
        vi_segment_end(&segment, length, phase, NULL, x, v);
        gone += length;
    }
}

VI_RARE static void fly(const vi_structure *s, const vi_parameter *parameter, vi_sensitivity *of, double u)
{
    const vi_phase now = vi_structure_phase(s);
    const double quarter = 1.57079632679489661923;
    for (int j = 0; j < vi_structure_free_modes(s->model); ++j) {
        const vi_mode *mode = &s->model->mode[j];
        if (parameter->phase != 0.0) {
            const vi_phase later = {now.angle + quarter, -now.sine, now.cosine};
            fly_mode(mode, parameter->phase * mode->force, later, u, &of->q[j], &of->p[j]);
        } else {
            fly_mode(mode, parameter->force[j], now, u, &of->q[j], &of->p[j]);
        }
    }
}

/* ---- integration, by extrapolation of the midpoint rule (Gragg, Bulirsch and Stoer) ---- */

/* A segment: a body of its own to evaluate at any instant and place. */
typedef struct {
    vi_structure s;
    vi_structure_state state;
    vi_instant start;
    const vi_parameter *parameter;
    bool with_motion; /* the derivative follows from the motion */
    /* Sizes to which errors are relative, of motion and derivative: those of the last steps. A derivative that begins at 0
     * has that of the first one tried. */
    double size[2];
    double terms[2]; /* largest terms of their accelerations, whose rounding is no error of a step */
} segment_of_change;

VI_RARE /* Forces that stops balance leave their rounding. */
    static void
    note_terms(segment_of_change *it, const vi_variation *change)
{
    for (int j = 0; j < vi_structure_free_modes(it->s.model); ++j) {
        const vi_mode *mode = &it->s.model->mode[j];
        const double of_motion = mode->force_size + fabs(it->state.held[j]) + fabs(mode->stiffness * it->state.q[j]);
        const double of_change = fabs(change->load[j]) + fabs(mode->stiffness * change->displacement[j])
                                 + fabs(2.0 * mode->decay * change->velocity[j]);
        it->terms[0] = vi_max(it->terms[0], of_motion);
        it->terms[1] = vi_max(it->terms[1], of_change);
    }
}

static void evaluate(segment_of_change *it, double u, double y[ROWS][VI_MODES], double rate[ROWS][VI_MODES])
{
    const int n = vi_structure_free_modes(it->s.model);
    const size_t size = (size_t)n * sizeof(double);
    double force[VI_PORTS];
    vi_variation change = {.base = 0.0};
    it->state.now = vi_clock_after(&it->s.model->clock, it->start, u);
    memcpy(it->state.q, y[MOTION], size);
    memcpy(it->state.p, y[MOTION + 1], size);
    memcpy(change.displacement, y[CHANGE], size);
    memcpy(change.velocity, y[CHANGE + 1], size);
    memset(rate, 0, sizeof(point));
    if (it->with_motion) {
        memcpy(rate[MOTION], y[MOTION + 1], size);
        vi_structure_accelerate(&it->s, rate[MOTION + 1], force);
    }
    vi_parameter_source(&it->s, it->parameter, &change);
    note_terms(it, &change);
    vi_structure_carry(&it->s, &change);
    memcpy(rate[CHANGE], y[CHANGE + 1], size);
    memcpy(rate[CHANGE + 1], change.load, size);
}

/* to = from + factor rate */
static void move_point(int n, double to[ROWS][VI_MODES], double from[ROWS][VI_MODES], double factor,
                       double rate[ROWS][VI_MODES])
{
    for (int row = 0; row < ROWS; ++row) {
        for (int j = 0; j < n; ++j) {
            to[row][j] = from[row][j] + factor * rate[row][j];
        }
    }
}

VI_RARE static void midpoint(segment_of_change *it, double u, double length, int steps, double y[ROWS][VI_MODES],
                             double end[ROWS][VI_MODES])
{
    const int n = vi_structure_free_modes(it->s.model);
    const double h = length / (double)steps;
    point before, here, rate;
    memcpy(before, y, sizeof before);
    evaluate(it, u, y, rate);
    move_point(n, here, y, h, rate);
    for (int i = 1; i < steps; ++i) {
        point next;
        evaluate(it, u + h * (double)i, here, rate);
        move_point(n, next, before, 2.0 * h, rate);
        memcpy(before, here, sizeof before);
        memcpy(here, next, sizeof here);
    }
    evaluate(it, u + length, here, rate);
    move_point(n, end, before, h, rate);
    for (int row = 0; row < ROWS; ++row) {
        for (int j = 0; j < n; ++j) {
            end[row][j] = 0.5 * (end[row][j] + here[row][j]);
        }
    }
}

/* Size of two rows, as velocities. */
VI_RARE static double size_of(int n, double y[ROWS][VI_MODES], int first, double rate)
{
    double size = 0.0;
    for (int j = 0; j < n; ++j) {
        size = vi_max(size, fabs(y[first][j]) * rate + fabs(y[first + 1][j]));
    }
    return size;
}

/* Is the error of a step within the tolerance of its size? A derivative that begins at 0 takes over a size that is roughly
 * right for the next steps. */
VI_RARE static bool is_accurate(segment_of_change *it, double length, double tolerance, double y[ROWS][VI_MODES],
                                double end[ROWS][VI_MODES], double error[ROWS][VI_MODES])
{
    const int n = vi_structure_free_modes(it->s.model);
    const double rate = vi_max(it->s.model->fastest, 1.0 / length);
    bool good = true;
    for (int first = it->with_motion ? MOTION : CHANGE; first < ROWS; first += CHANGE) {
        const int which = first / CHANGE;
        const double reached = size_of(n, end, first, rate), wrong = size_of(n, error, first, rate);
        const double size = vi_max(it->size[which], vi_max(size_of(n, y, first, rate), reached));
        good = good && wrong <= tolerance * size + ROUNDING * it->terms[which] * length;
        if (good || (wrong <= ROUGHLY * reached && size_of(n, y, first, rate) == 0.0)) {
            it->size[which] = vi_max(it->size[which], reached);
        }
    }
    return good;
}

/* One step from y; returns the columns that it needed, 0 when the error stays above the tolerance. */
VI_RARE static int extrapolate(segment_of_change *it, double u, double length, double tolerance,
                               double y[ROWS][VI_MODES], double end[ROWS][VI_MODES])
{
    const int n = vi_structure_free_modes(it->s.model);
    point column[COLUMNS], error;
    for (int k = 0; k < COLUMNS; ++k) {
        midpoint(it, u, length, STEPS[k], y, column[k]);
        for (int l = k - 1; l >= 0; --l) {
            const double ratio = (double)STEPS[k] / (double)STEPS[l];
            move_point(n, error, column[l + 1], -1.0, column[l]);
            move_point(n, column[l], column[l + 1], 1.0 / (ratio * ratio - 1.0), error);
        }
        memcpy(end, column[0], sizeof column[0]);
        if (k < LEAST) {
            continue;
        }
        move_point(n, error, column[0], -1.0, column[1]);
        if (is_accurate(it, length, tolerance, y, end, error)) {
            return k + 1;
        }
    }
    return 0;
}

static bool follows_motion(const vi_structure *s, const vi_parameter *parameter)
{
    bool follows = parameter->mass != 0.0 || parameter->damping != 0.0 || parameter->stiffness != 0.0;
    for (int k = 0; k < s->model->contacts; ++k) {
        follows = follows || s->state->status[k] == VI_CONTACT_YIELDING;
    }
    return follows;
}

/* Fastest rate of the modes and of the linear stops that press, rad/s. */
VI_RARE static double fastest_rate(const vi_structure *s)
{
    double rate = s->model->fastest;
    for (int k = 0; k < s->model->contacts; ++k) {
        if (s->state->status[k] == VI_CONTACT_YIELDING) {
            const vi_contact_force slopes = vi_structure_yield(s, k);
            const double mobility = s->model->compliance[k][k];
            rate += sqrt(slopes.stiffness * mobility) + slopes.damping * mobility;
        }
    }
    return rate;
}

VI_RARE static void integrate(const vi_structure *s, const vi_parameter *parameter, vi_sensitivity *of, double u)
{
    const size_t size = (size_t)vi_structure_free_modes(s->model) * sizeof(double);
    const double fastest = fastest_rate(s);
    segment_of_change it = {*s,         *s->state, s->state->now, parameter, follows_motion(s, parameter),
                            {0.0, 0.0}, {0.0, 0.0}};
    point y, end;
    it.s.state = &it.state;
    memset(it.state.leaving, 0, sizeof it.state.leaving);
    it.state.exchange.on = 1; /* forces go on smoothly beyond the end of their contact, as for any integrator */
    memset(y, 0, sizeof y);
    memcpy(y[MOTION], s->sensitive->before_q, size);
    memcpy(y[MOTION + 1], s->sensitive->before_p, size);
    memcpy(y[CHANGE], of->q, size);
    memcpy(y[CHANGE + 1], of->p, size);
    double gone = 0.0, step = fastest > 0.0 ? vi_min(u, FIRST / fastest) : u, tolerance = TOLERANCE;
    while (gone < u && !of->undefined) {
        const bool last = step >= u - gone;
        const double length = last ? u - gone : step;
        const int columns = extrapolate(&it, gone, length, tolerance, y, end);
        if (columns == 0 && length > SHORTEST * u) {
            step = SHORTER * length;
            tolerance *= LOOSER;
            continue;
        }
        tolerance = TOLERANCE;
        of->undefined |= !(isfinite(size_of(vi_structure_free_modes(s->model), end, CHANGE, 1.0)));
        it.size[0] *= REMEMBERED;
        it.size[1] *= REMEMBERED;
        memcpy(y, end, sizeof y);
        gone = last ? u : gone + length;
        step = columns <= EASY ? LONGER * length : length;
    }
    memcpy(of->q, y[CHANGE], size);
    memcpy(of->p, y[CHANGE + 1], size);
}

VI_RARE void vi_variational_flow(const vi_structure *s, int i, double u)
{
    const vi_parameter *parameter = &s->sensitive->parameter[i];
    vi_sensitivity *of = &s->sensitive->of[i];
    if (is_flight(s) && is_load(parameter)) {
        fly(s, parameter, of, u);
    } else {
        integrate(s, parameter, of, u);
    }
}
