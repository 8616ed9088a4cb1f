#include "body/modal/structure/extremes.h"

#include <float.h>
#include <math.h>

#include "body/landing.h"
#include "motion/majorant.h"

/* Nodes and weights of Gauss-Legendre quadrature with eight points on [-1, 1] (the other half by symmetry). */
static const double NODES[4] = {0.18343464249564980494, 0.52553240991632898582, 0.79666647741362673959,
                                0.96028985649753623168};
static const double WEIGHTS[4] = {0.36268378337836198297, 0.31370664587788728734, 0.22238103445337447054,
                                  0.10122853629037625915};
/* Length of a piece of quadrature, in units of 1 / fastest rate; eight points then integrate to the last digits. */
static const double PIECE = 1.5;

/* Pieces of a segment of drift, which may be 5 / fastest rate long. */
enum { DRIFT_PIECES = 4 };

/* Most turning points of a polynomial that are searched in one segment. */
enum { MOST_TURNS = 16 };

/* Cost of a climb in the budget, in evaluations of all modes. */
enum { CLIMB = 8 };

/* ---- extremes ---- */

/* The points whose extremes are kept: OBSERVED, then the further ones from 0. */
enum { OBSERVED = -1 };

static const double *shape_of(const vi_structure *s, int point)
{
    return point == OBSERVED ? s->model->observed : s->model->shape[s->model->contacts + point];
}

static double displacement_of(const vi_structure *s, int point)
{
    return point == OBSERVED ? vi_structure_observed(s) : vi_structure_at(s->model, shape_of(s, point), s->state->q);
}

static void extend(const vi_structure *s, int point, double displacement)
{
    if (point == OBSERVED) {
        vi_record_extend(s->record, vi_structure_within(s, displacement));
    } else {
        vi_record_point_extend(s->record, point, displacement);
    }
}

/* The largest displacement * sign so far. */
static double largest_so_far(const vi_structure *s, int point, double sign)
{
    const vi_record_point *p = &s->record->point[point < 0 ? 0 : point];
    const double high = point == OBSERVED ? s->record->displacement_max : p->displacement_max;
    const double low = point == OBSERVED ? s->record->displacement_min : p->displacement_min;
    return sign < 0.0 ? -low : high;
}

/* Climb from u to the next turning point of the observed displacement times sign; returns the time of this point. */
static double climb(const vi_flight *flight, const vi_point *point, double u, double end, double *top)
{
    vi_flight_instant now;
    for (int evaluation = 0;; ++evaluation) {
        vi_flight_at(flight, u, &now);
        const vi_approach p = vi_point_approach(point, flight, &now);
        *top = p.clearance; /* clearance of a stop above: falls as the point rises */
        const double noise = 4.0 * DBL_EPSILON * (fabs(p.velocity) + point->scale * flight->model->fastest);
        if (!(p.velocity > noise) || u >= end) {
            return u;
        }
        /* search the velocity's fall to zero like a clearance's */
        const vi_approach fall = {p.velocity, -p.acceleration, -p.jerk, p.bound, 0.0};
        u = vi_min(end, u + vi_max(vi_certified_step(&fall, end - u), vi_least_step(end, 1e-12, evaluation)));
    }
}

/* Find the largest displacement * sign over the flight; regions below the largest value so far are skipped. */
static void extreme(const vi_structure *s, const vi_flight *flight, int seen, double sign, double end)
{
    vi_flight_instant now;
    vi_point point;
    const double here = displacement_of(s, seen), best = vi_max(largest_so_far(s, seen, sign), sign * here);
    double u = 0.0;
    vi_point_start(&point, flight, shape_of(s, seen), sign, best - sign * here);
    const double start = point.offset, least = VI_ROUNDING * point.scale;
    for (int evaluation = 0; u < end; ++evaluation) {
        const double least_step = vi_least_step(end, 1e-9, evaluation);
        vi_budget_spend(&s->state->budget, vi_structure_modes(s->model));
        vi_flight_at(flight, u, &now);
        const vi_approach p = vi_point_approach(&point, flight, &now);
        if (p.clearance <= least && p.velocity > 0.0) {
            double top;
            u = climb(flight, &point, u, end, &top);
            vi_budget_spend(&s->state->budget, CLIMB * vi_structure_modes(s->model));
            point.offset += vi_max(0.0, -top); /* raise the bar to the value reached */
            u += least_step;
            continue;
        }
        point.offset += least;
        u += vi_max(vi_point_step(&point, flight, &now, end - u), least_step);
        point.offset -= least;
    }
    vi_flight_at(flight, end, &now);
    point.offset += vi_max(0.0, -vi_point_approach(&point, flight, &now).clearance);
    extend(s, seen, sign * (best + (point.offset - start)));
}

void vi_extremes_of_flight(const vi_structure *s, const vi_flight *flight, double u)
{
    vi_extremes_here(s);
    for (int point = OBSERVED; point < s->model->further && u > 0.0; ++point) {
        extreme(s, flight, point, 1.0, u);
        extreme(s, flight, point, -1.0, u);
    }
}

void vi_extremes_here(const vi_structure *s)
{
    vi_record_extend(s->record, vi_structure_observed(s));
    for (int point = 0; point < s->model->further; ++point) {
        vi_record_point_extend(s->record, point, displacement_of(s, point));
    }
}

static void differentiate(const double c[VI_ORDER + 1], double sign, double slope[VI_ORDER + 1])
{
    for (int n = 0; n < VI_ORDER; ++n) {
        slope[n] = sign * (double)(n + 1) * c[n + 1];
    }
    slope[VI_ORDER] = 0.0;
}

/* Time of the next turning point of a polynomial after `from`; HUGE_VAL when there is none up to the end. */
static double next_turn(const double polynomial[VI_ORDER + 1], double from, double end)
{
    double slope[VI_ORDER + 1], value[4];
    vi_polynomial_at(polynomial, from, value);
    const double sign = value[1] != 0.0 ? copysign(1.0, value[1]) : copysign(1.0, value[2]);
    differentiate(polynomial, sign, slope);
    const vi_fall fall = vi_polynomial_fall(slope, from, end, 4.0 * DBL_EPSILON * vi_polynomial_size(slope, end));
    return fall.found ? fall.time : HUGE_VAL;
}

static void extremes_of_point(const vi_structure *s, const vi_drift *drift, int point, double end)
{
    double polynomial[VI_ORDER + 1], value[4], from = 0.0;
    const double here = vi_structure_at(s->model, shape_of(s, point), s->state->q);
    vi_drift_point(drift, shape_of(s, point), polynomial);
    extend(s, point, here);
    vi_polynomial_at(polynomial, end, value);
    extend(s, point, here + value[0]);
    if (vi_polynomial_size(polynomial, end) <= VI_ROUNDING * fabs(here)) {
        return; /* the point is held: its polynomial is mere rounding */
    }
    for (int turn = 0; turn < MOST_TURNS && from < end; ++turn) {
        const double at = next_turn(polynomial, from, end);
        if (!(at < HUGE_VAL)) {
            return;
        }
        vi_polynomial_at(polynomial, at, value);
        extend(s, point, here + value[0]);
        from = at + 1e-3 * end;
    }
}

void vi_extremes_of_drift(const vi_structure *s, const vi_drift *drift, double u)
{
    for (int point = OBSERVED; point < s->model->further; ++point) {
        extremes_of_point(s, drift, point, vi_drift_variable(drift, u));
    }
}

/* ---- largest forces ---- */

/* The largest value of a polynomial on [0, end]. */
static double largest_value(const double polynomial[VI_ORDER + 1], double end)
{
    double value[4], from = 0.0;
    vi_polynomial_at(polynomial, end, value);
    double largest = vi_max(polynomial[0], value[0]);
    for (int turn = 0; turn < MOST_TURNS && from < end; ++turn) {
        const double at = next_turn(polynomial, from, end);
        if (!(at < HUGE_VAL)) {
            return largest;
        }
        vi_polynomial_at(polynomial, at, value);
        largest = vi_max(largest, value[0]);
        from = at + 1e-3 * end;
    }
    return largest;
}

void vi_peaks_of_drift(const vi_structure *s, const vi_drift *drift, double u)
{
    for (int k = 0; k < s->model->contacts; ++k) {
        if (vi_structure_follows_peak(s, k)) {
            const double largest = largest_value(drift->force[k], vi_drift_variable(drift, u));
            s->state->touch_down[k].peak = vi_max(s->state->touch_down[k].peak, largest);
        }
    }
}

/* ---- energies ---- */

/* Load on mode j by the further sines and by the terms of degree 2 and above. */
static double further_load(const vi_structure *s, int j, double u, const vi_phase further[])
{
    double value[4] = {0.0}, coefficient[VI_HIGHER_ROOM];
    for (int n = 2; n <= vi_structure_degree(s); ++n) {
        coefficient[n - 2] = s->state->higher[n - 2][j];
    }
    if (vi_structure_degree(s) > 1) {
        vi_add_higher(coefficient, vi_structure_degree(s), u, value);
    }
    return value[0] + vi_further_force(&s->model->mode[j], further);
}

/* Add the power of the applied forces and of the damping at modal velocities p and forcing phase `angle`. */
static void add_powers(const vi_structure *s, const double p[], const double held[], double u, double angle,
                       const vi_phase further[], double weight)
{
    const vi_structure_model *model = s->model;
    const double cosine = cos(angle);
    double work = 0.0, loss = 0.0;
    for (int j = 0; j < vi_structure_modes(model); ++j) {
        const vi_mode *mode = &model->mode[j];
        work += (mode->force * cosine + held[j] + s->state->held_rate[j] * u) * p[j];
        work += vi_structure_is_plain(s) ? 0.0 : further_load(s, j, u, further) * p[j];
        loss += p[j] * (model->coupled ? vi_structure_at(model, model->coupling[j], p) : 2.0 * mode->decay * p[j]);
    }
    s->state->energies.forcing_work += weight * work;
    s->state->energies.damping_loss += weight * loss;
}

/* The i-th of the eight nodes of a piece from `start`, and its weight. */
static double node(double start, double piece, int i, double *weight)
{
    const double middle = start + 0.5 * piece, half = 0.5 * piece;
    *weight = half * WEIGHTS[i % 4];
    return i < 4 ? middle - half * NODES[i] : middle + half * NODES[i % 4];
}

double vi_energies_reach(const vi_structure *s)
{
    return s->state->follow_energies ? VI_MOST_EVALUATIONS / 8 * PIECE / s->model->fastest : HUGE_VAL;
}

void vi_energies_of_flight(const vi_structure *s, const vi_flight *flight, const double held[], double u)
{
    const double count = ceil(vi_max(1.0, u * s->model->fastest / PIECE)), piece = u / count;
    double q[VI_MODES], p[VI_MODES], weight;
    vi_phase further[VI_SINES_ROOM];
    vi_budget_spend(&s->state->budget, (int64_t)(8.0 * count) * vi_structure_modes(s->model));
    for (double n = 0.0; n < count; n += 1.0) {
        for (int i = 0; i < 8; ++i) {
            const double t = node(n * piece, piece, i, &weight);
            const double angle = flight->drive.phase.angle + flight->angular_frequency * t;
            vi_flight_further(flight, t, further);
            vi_flight_end(flight, t, angle, further, q, p);
            add_powers(s, p, held, t, angle, further, weight);
        }
    }
}

void vi_energies_of_drift(const vi_structure *s, const vi_drift *drift, const double held[], const int still[],
                          double u)
{
    const double w = s->model->clock.angular_frequency, angle = w * s->state->now.rest;
    const double piece = vi_drift_variable(drift, u) / (double)DRIFT_PIECES;
    double q[VI_MODES], p[VI_MODES], weight, value[4];
    const vi_phase *start = vi_structure_further(s);
    vi_phase further[VI_SINES_ROOM];
    for (int i = 0; i < 8 * DRIFT_PIECES; ++i) {
        const double r = node((double)(i / 8) * piece, piece, i % 8, &weight), t = drift->rooted ? r * r : r;
        const double slope = drift->rooted ? 2.0 * r : 1.0; /* derivative of t over r */
        vi_drift_at(drift, t, s->state->q, p, q);
        vi_further_after(&s->model->mode[0], start, t, further);
        add_powers(s, p, held, t, angle + w * t, further, slope * weight);
        for (int k = 0; k < s->model->contacts; ++k) {
            if (s->state->status[k] == VI_CONTACT_YIELDING && !still[k]) {
                vi_polynomial_at(drift->force[k], r, value);
                const double force = value[0];
                vi_polynomial_at(drift->penetration[k], r, value);
                s->state->energies.contact_loss += weight * force * value[1];
            }
        }
    }
}

void vi_energies_of_rounding(const vi_structure *s, const vi_drift *drift, const double q[], const double held[],
                             double u)
{
    const double cosine = cos(s->model->clock.angular_frequency * (s->state->now.rest + u)), zero[VI_MODES] = {0.0};
    double moved[VI_MODES], p[VI_MODES], work = 0.0, way = 0.0, undone = 0.0;
    vi_phase further[VI_SINES_ROOM];
    vi_further_after(&s->model->mode[0], vi_structure_further(s), u, further);
    vi_drift_at(drift, u, zero, p, moved);
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        const double back = q[j] + moved[j] - s->state->q[j];
        work += (s->model->mode[j].force * cosine + held[j] + s->state->held_rate[j] * u) * back;
        work += vi_structure_is_plain(s) ? 0.0 : further_load(s, j, u, further) * back;
        way += fabs(moved[j]);
        undone += fabs(back);
    }
    s->state->energies.forcing_work -= undone > 0.5 * way ? work : 0.0;
}
