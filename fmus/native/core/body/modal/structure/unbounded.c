#include "body/modal/structure/unbounded.h"

#include <math.h>

#include "body/landing.h"
#include "motion/majorant.h"

/* Halvings of a segment towards the first instant at which the motion is unbounded. */
enum { HALVINGS = 60 };

/* ---- the limit ---- */

/* Largest displacement of the observed points and of the contacts, m. */
static double farthest(const vi_structure *s, const double q[])
{
    const vi_structure_model *model = s->model;
    double most = fabs(vi_structure_at(model, model->observed, q));
    for (int r = 0; r < model->rows; ++r) {
        most = vi_max(most, fabs(vi_structure_at(model, model->shape[r], q)));
    }
    return most;
}

static bool is_beyond(const vi_structure *s, const double q[])
{
    return farthest(s, q) > s->model->displacement_limit;
}

/* ---- stops out of reach ---- */

/* Distance by which the unforced part of a mode may come closer to a stop from now on, m, for a weight towards the stop;
 * HUGE_VAL where it is not bounded. *leaves: the mode grows away from the stop. */
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

/* Is contact k out of reach for ever? */
static bool never_meets(const vi_structure *s, const vi_flight *flight, const vi_point *point, int k,
                        const vi_flight_instant *now, bool *leaves)
{
    const vi_approach p = vi_point_approach(point, flight, now);
    const double here = point->sign * (point->cosine * now->cosine + point->sine * now->sine);
    const bool on_stop = now->u == 0.0 && s->state->status[k] == VI_CONTACT_TOUCHING;
    double closer = point->steady > 0.0 ? point->steady - here : 0.0;
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
    if (!s->model->ends_unbounded || s->model->asks || flight->series || s->model->varies) {
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

static bool flight_is_unbounded(const vi_structure *s, const vi_flight *flight, const vi_point points[],
                                vi_unbounded reason, double u)
{
    double q[VI_MODES], p[VI_MODES];
    if (reason == VI_STOPS_OUT_OF_REACH) {
        return is_out_of_reach(s, flight, points, u);
    }
    vi_flight_end(flight, u, flight->phase.angle + flight->angular_frequency * u, q, p);
    return is_beyond(s, q);
}

/* Halve [0, *u] towards the first instant; both reasons hold from their first instant on. */
static void end_flight(const vi_structure *s, const vi_flight *flight, const vi_point points[], vi_unbounded reason,
                       double *u)
{
    double low = 0.0, high = flight_is_unbounded(s, flight, points, reason, 0.0) ? 0.0 : *u;
    for (int i = 0; i < HALVINGS && low < high; ++i) {
        const double middle = 0.5 * (low + high);
        *(flight_is_unbounded(s, flight, points, reason, middle) ? &high : &low) = middle;
    }
    vi_budget_spend(&s->state->budget, HALVINGS * vi_structure_modes(s->model));
    s->state->unbounded = (int32_t)reason;
    *u = high;
}

bool vi_unbounded_flight(const vi_structure *s, const vi_flight *flight, const vi_point points[], double *u)
{
    if (!vi_structure_grows(s->model)) {
        return false;
    }
    const bool limited = s->model->displacement_limit > 0.0, alone = is_left_alone(s, flight);
    vi_budget_spend(&s->state->budget, (limited + alone) * vi_structure_modes(s->model));
    if (limited && flight_is_unbounded(s, flight, points, VI_BEYOND_LIMIT, *u)) {
        end_flight(s, flight, points, VI_BEYOND_LIMIT, u);
    }
    if (alone && flight_is_unbounded(s, flight, points, VI_STOPS_OUT_OF_REACH, *u)) {
        end_flight(s, flight, points, VI_STOPS_OUT_OF_REACH, u);
    }
    return s->state->unbounded != VI_BOUNDED;
}

bool vi_unbounded_drift(const vi_structure *s, const vi_drift *drift, double *u)
{
    double low = 0.0, high = *u, q[VI_MODES], p[VI_MODES];
    if (!vi_structure_grows(s->model) || !(s->model->displacement_limit > 0.0)) {
        return false;
    }
    vi_drift_at(drift, high, s->state->q, p, q);
    if (!is_beyond(s, q)) {
        return false;
    }
    for (int i = 0; i < HALVINGS && low < high; ++i) {
        const double middle = 0.5 * (low + high);
        vi_drift_at(drift, middle, s->state->q, p, q);
        *(is_beyond(s, q) ? &high : &low) = middle;
    }
    s->state->unbounded = VI_BEYOND_LIMIT;
    *u = high;
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
