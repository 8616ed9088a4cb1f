#include "body/modal/structure/unbounded.h"

#include <math.h>

#include "body/landing.h"
#include "motion/majorant.h"

/* Halvings of a segment towards the first instant at which the motion is unbounded. */
enum { HALVINGS = 60 };

/* ---- the limit ---- */

/* Shape of an observed point or contact: a row of the model's shapes; the row behind them is the observed point. */
static const double *shape_of(const vi_structure *s, int row)
{
    return row < s->model->rows ? s->model->shape[row] : s->model->observed;
}

/* Bound of the displacement of a point over a flight, m; HUGE_VAL under loads of a higher degree. */
static double reach_of(const vi_flight *flight, const vi_flight_instant *start, const vi_point *point)
{
    double reach = point->steady + fabs(point->level) + fabs(point->level_rate) * flight->length;
    if (vi_flight_degree(flight) > 1) {
        return HUGE_VAL;
    }
    for (int k = 0; k < flight->sines; ++k) {
        reach += point->further[k].amplitude;
    }
    for (int j = 0; j < vi_structure_modes(flight->model); ++j) {
        const vi_segment *segment = &flight->segment[j];
        reach += point->shape[j] != 0.0 ? fabs(point->shape[j]) * (start->part[j].reach + fabs(segment->origin)) : 0.0;
    }
    return reach;
}

/* Time within `end` at which a point passes the limit on the side of `sign`; HUGE_VAL where it does not. */
static double time_beyond(const vi_structure *s, const vi_flight *flight, const vi_flight_instant *start, int row,
                          double sign, double end)
{
    vi_point point;
    vi_flight_instant now = *start;
    const double limit = s->model->displacement_limit, *shape = shape_of(s, row);
    vi_point_start(&point, flight, shape, sign, limit - sign * vi_structure_at(s->model, shape, s->state->q));
    if (reach_of(flight, start, &point) < limit) {
        return HUGE_VAL;
    }
    for (int evaluation = 0; evaluation < VI_MOST_EVALUATIONS; ++evaluation) {
        const vi_approach p = vi_point_approach(&point, flight, &now);
        const double step = vi_point_step(&point, flight, &now, end - now.u);
        if (p.clearance <= VI_ROUNDING * point.scale) {
            return now.u;
        }
        if (!(step < end - now.u)) {
            return HUGE_VAL;
        }
        vi_budget_spend(&s->state->budget, vi_structure_modes(s->model));
        vi_flight_at(flight, vi_max(now.u + step, nextafter(now.u, HUGE_VAL)), &now);
    }
    return now.u;
}

static double flight_beyond(const vi_structure *s, const vi_flight *flight, double end)
{
    double first = HUGE_VAL;
    vi_flight_instant start;
    vi_flight_at(flight, 0.0, &start);
    for (int row = 0; row <= s->model->rows; ++row) {
        for (double sign = -1.0; sign <= 1.0; sign += 2.0) {
            first = vi_min(first, time_beyond(s, flight, &start, row, sign, vi_min(end, first)));
        }
    }
    return first;
}

static double drift_beyond(const vi_structure *s, const vi_drift *drift, double end)
{
    double first = HUGE_VAL;
    for (int row = 0; row <= s->model->rows; ++row) {
        for (double sign = -1.0; sign <= 1.0; sign += 2.0) {
            const double *shape = shape_of(s, row);
            double room[VI_ORDER + 1];
            vi_drift_point(drift, shape, room);
            for (int n = 0; n <= VI_ORDER; ++n) {
                room[n] *= -sign;
            }
            room[0] += s->model->displacement_limit - sign * vi_structure_at(s->model, shape, s->state->q);
            if (!(room[0] > 0.0)) {
                return 0.0;
            }
            const vi_fall fall = vi_polynomial_fall(room, 0.0, end, VI_ROUNDING * vi_polynomial_size(room, end));
            first = fall.found ? vi_min(first, fall.time) : first;
        }
    }
    return first;
}

/* ---- stops out of reach ---- */

/* Distance by which the unforced part of a mode may come closer to a stop from now on, m; HUGE_VAL where it is not
 * bounded. `weight`: of the mode towards the stop. *leaves: the mode grows away from the stop. */
static double approach_of(const vi_segment *segment, const vi_part *part, double weight, bool *leaves)
{
    const vi_mode *mode = segment->mode;
    const double x = weight * part->x, v = weight * part->v;
    if (x == 0.0 && v == 0.0) {
        return 0.0;
    }
    if (!vi_mode_grows(mode)) {
        if (mode->natural > 0.0) {
            return vi_max(0.0, fabs(weight) * part->reach - x);
        }
        return v <= 0.0 ? 0.0 : mode->decay > 0.0 ? v / (2.0 * mode->decay) : HUGE_VAL;
    }
    if (mode->regime != VI_OVERDAMPED) {
        return HUGE_VAL;
    }
    /* the two exponentials, the first of which grows fastest */
    const double first = (v + mode->fast * x) / (2.0 * mode->rate), second = -(v + mode->slow * x) / (2.0 * mode->rate);
    if (!(first < 0.0)) {
        return HUGE_VAL;
    }
    *leaves = true;
    if (mode->fast >= 0.0) {
        return vi_max(0.0, -second);
    }
    return mode->slow * first >= -mode->fast * second ? 0.0 : HUGE_VAL;
}

/* Distance by which a steady response of this amplitude may come closer to its stop, m. */
static double swing_of(double amplitude, double cosine, double sine, double sign, double c, double s)
{
    return amplitude > 0.0 ? amplitude - sign * (cosine * c + sine * s) : 0.0;
}

/* Is contact k out of reach for ever? */
static bool never_meets(const vi_structure *s, const vi_flight *flight, const vi_point *point, int k,
                        const vi_flight_instant *now, bool *leaves)
{
    const vi_approach p = vi_point_approach(point, flight, now);
    const bool on_stop = now->u == 0.0 && s->state->status[k] == VI_CONTACT_TOUCHING;
    double closer = swing_of(point->steady, point->cosine, point->sine, point->sign, now->cosine, now->sine);
    for (int i = 0; i < flight->sines; ++i) {
        const vi_point_sine *sine = &point->further[i];
        const vi_phase *phase = &now->further[i];
        closer += swing_of(sine->amplitude, sine->cosine, sine->sine, point->sign, phase->cosine, phase->sine);
    }
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        closer += approach_of(&flight->segment[j], &now->part[j], point->sign * point->shape[j], leaves);
    }
    if (on_stop) {
        return !s->state->leaving[k] && closer == 0.0 && p.velocity < -VI_ROUNDING * vi_structure_velocity_size(s, k);
    }
    return p.clearance - closer > VI_ROUNDING * point->scale;
}

/* Is there a stop, and are all stops out of reach while the loads stay as they are? */
static bool is_out_of_reach(const vi_structure *s, const vi_flight *flight, const vi_point points[], double u)
{
    bool leaves = false;
    vi_flight_instant now;
    vi_flight_at(flight, u, &now);
    for (int k = 0; k < s->model->contacts; ++k) {
        if (vi_structure_watched(s, k) && !never_meets(s, flight, &points[k], k, &now, &leaves)) {
            return false;
        }
    }
    return leaves;
}

/* May the certificate be asked for? Loads that change, and stops of other components, may bring the motion back. */
static bool is_left_alone(const vi_structure *s, const vi_flight *flight)
{
    const bool lasts = VI_DEGREE == 1 || s->state->loads_last == HUGE_VAL;
    if (!s->model->ends_unbounded || !lasts || s->model->asks || flight->series || s->model->varies
        || vi_flight_degree(flight) > 1) {
        return false;
    }
    for (int j = 0; j < vi_structure_modes(s->model); ++j) {
        if (s->state->held_rate[j] != 0.0) {
            return false;
        }
    }
    return true;
}

/* ---- the end ---- */

/* The first instant at which all stops are out of reach, in (0, high] or 0; from then on they stay so. */
static double first_out_of_reach(const vi_structure *s, const vi_flight *flight, const vi_point points[], double high)
{
    double low = 0.0;
    vi_budget_spend(&s->state->budget, HALVINGS * vi_structure_modes(s->model));
    if (is_out_of_reach(s, flight, points, 0.0)) {
        return 0.0;
    }
    for (int i = 0; i < HALVINGS; ++i) {
        const double middle = 0.5 * (low + high);
        *(is_out_of_reach(s, flight, points, middle) ? &high : &low) = middle;
    }
    return high;
}

bool vi_unbounded_flight(const vi_structure *s, const vi_flight *flight, const vi_point points[], bool meets,
                         double *u)
{
    if (s->model->displacement_limit > 0.0) {
        const double passed = flight_beyond(s, flight, *u);
        s->state->unbounded = passed < HUGE_VAL ? VI_BEYOND_LIMIT : VI_BOUNDED;
        *u = vi_min(*u, passed);
    }
    if (!meets && is_left_alone(s, flight) && is_out_of_reach(s, flight, points, *u)) {
        s->state->unbounded = VI_STOPS_OUT_OF_REACH;
        *u = first_out_of_reach(s, flight, points, *u);
    }
    return s->state->unbounded != VI_BOUNDED;
}

bool vi_unbounded_drift(const vi_structure *s, const vi_drift *drift, double *u)
{
    if (!(s->model->displacement_limit > 0.0)) {
        return false;
    }
    const double passed = drift->rooted ? HUGE_VAL : drift_beyond(s, drift, *u);
    if (!(passed < HUGE_VAL)) {
        return false;
    }
    s->state->unbounded = VI_BEYOND_LIMIT;
    *u = passed;
    return true;
}

void vi_complain_of_growth(const vi_structure *s, char message[VI_MESSAGE_LENGTH], double time)
{
    if (s->state->unbounded == VI_BEYOND_LIMIT) {
        vi_complain(message, "unbounded: a displacement passed displacement_limit, %.6g m, at time %.17g s",
                    s->model->displacement_limit, time);
    } else {
        vi_complain(message, "unbounded: no stop can be met any more from time %.17g s on", time);
    }
}
