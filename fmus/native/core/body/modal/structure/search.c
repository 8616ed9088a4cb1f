#include "body/modal/structure/search.h"

#include <float.h>
#include <math.h>

#include "body/landing.h"
#include "body/modal/modal_scan.h"
#include "motion/majorant.h"

/* Longest last step to a contact, in radians of the fastest rate. */
static const double LAST_STEP = 1e-5;
/* Time from an evaluated instant to a contact, in radians of the fastest rate, whose third power is a rounding. */
static const double NEAR = 6e-6;
/* Evaluations between two scans after a scan without result. */
enum { PATIENCE = 4 };
static const double SIXTH = 1.0 / 6.0;
/* Most iterations towards a contact that is bracketed between two instants; two are usual. */
enum { MOST_ITERATIONS = 16 };

void vi_search_points(const vi_structure *s, const vi_flight *flight, vi_point points[])
{
    for (int k = 0; k < s->model->contacts; ++k) {
        vi_point_start(&points[k], flight, s->model->shape[k], vi_structure_direction(s, k),
                       vi_structure_clearance(s, k));
        points[k].scale += fabs(s->contacts[k].position);
    }
}

bool vi_search_is_idle(const vi_structure *s, const vi_flight *flight, const vi_point points[])
{
    for (int k = 0; k < s->model->contacts; ++k) {
        double reach;
        if (vi_structure_watched(s, k)
            && (s->state->status[k] == VI_CONTACT_TOUCHING || !vi_point_reach(&points[k], flight, &reach)
                || !(reach < points[k].sign * s->contacts[k].position))) {
            return false;
        }
    }
    return true;
}

/* ---- the instant reached ---- */

/* Last step to the contact at this approach, by the parabola that touches the motion there. 0 where the velocity, like
 * the clearance, is mere rounding. */
static double landing_step(const vi_structure_model *model, const vi_approach *p)
{
    const double square = p->velocity * p->velocity + 2.0 * p->acceleration * p->clearance;
    const double step = square >= 0.0 ? 2.0 * p->clearance / (p->velocity + sqrt(square))
                                      : -p->velocity / p->acceleration;
    return step * model->fastest < LAST_STEP ? step : 0.0;
}

/* Set the exactly known start of a contact that leaves its stop. */
static void correct_start(const vi_structure *s, int k, vi_approach *p)
{
    p->clearance = 0.0;
    p->velocity = s->state->leaving[k] ? 0.0 : p->velocity;
    p->acceleration = s->state->leaving[k] >= 2 ? 0.0 : p->acceleration;
}

/* Is a contact on its stop, within rounding, pulled off again before an approach of rounding size can meet it? */
static bool turns_back(const vi_approach *p, double noise)
{
    return p->clearance <= noise && p->velocity > 0.0
           && p->velocity * p->velocity <= -2.0 * p->acceleration * noise;
}

static bool starts_on_stop(const vi_structure *s, int k, double u)
{
    return u == 0.0 && s->state->status[k] == VI_CONTACT_TOUCHING;
}

/* Find the approach of each watched contact at an instant; false beyond the largest numbers. */
static bool look(const vi_structure *s, const vi_flight *flight, const vi_point points[], const int looked_for[],
                 const vi_flight_instant *now, vi_approach approach[])
{
    for (int k = 0; k < s->model->contacts; ++k) {
        if (!looked_for[k]) {
            continue;
        }
        vi_approach *p = &approach[k];
        *p = vi_point_approach(&points[k], flight, now);
        if (starts_on_stop(s, k, now->u)) {
            correct_start(s, k, p);
        }
        if (!isfinite(p->bound) || !isfinite(p->jerk)) {
            return false;
        }
        p->clearance = vi_max(0.0, p->clearance);
        if (now->u == 0.0 && turns_back(p, VI_ROUNDING * points[k].scale)) {
            p->velocity = 0.0;
        }
    }
    return true;
}

/* ---- a contact between two instants ---- */

static vi_search_end meet(vi_search_found *found, int k, double moment, double fastest)
{
    found->contact = k;
    found->u = found->now.u + moment;
    found->moment = fabs(moment) * fastest <= NEAR ? moment : NAN;
    return VI_SEARCH_CONTACT;
}

/* Step to the zero of the cubic that touches the motion here, forward or back; NaN when there is none. */
static double step_to_zero(const vi_approach *p)
{
    const double square = p->velocity * p->velocity + 2.0 * p->acceleration * p->clearance;
    if (!(p->velocity > 0.0) || !(square > 0.0)) {
        return NAN;
    }
    const double step = 2.0 * p->clearance / (p->velocity + sqrt(square));
    return step - p->jerk * (step * step * step * SIXTH) / (p->velocity + p->acceleration * step);
}

/* Is the error of the cubic below the rounding of the displacement and of the velocity? */
static bool is_exact(const vi_approach *p, double step, double scale)
{
    const double cube = fabs(step * step * step);
    return p->bound * cube * fabs(step) <= 8.0 * DBL_EPSILON * scale && p->bound * cube <= DBL_EPSILON * p->velocity;
}

/* Newton's method on the exact motion, kept between two instants that bracket the contact. */
static bool close_in(const vi_structure *s, const vi_flight *flight, const vi_point *point, const vi_scan_found *bracket,
                     vi_search_found *found)
{
    double low = bracket->low, high = bracket->high, u = bracket->guess;
    for (int i = 0; i < MOST_ITERATIONS; ++i) {
        vi_budget_spend(&s->state->budget, vi_structure_modes(s->model));
        vi_flight_at(flight, u, &found->now);
        const vi_approach p = vi_point_approach(point, flight, &found->now);
        const double step = step_to_zero(&p);
        if (fabs(step) * s->model->fastest <= NEAR && is_exact(&p, step, point->scale)) {
            (void)meet(found, bracket->contact, step, s->model->fastest);
            return true;
        }
        *(p.clearance > 0.0 ? &low : &high) = u;
        const double next = u + step;
        u = next > low && next < high ? next : 0.5 * (low + high);
    }
    return false;
}

/* ---- the search ---- */

/* Make one certified step; *goes_on says whether the search goes on. */
static vi_search_end step_on(const vi_structure *s, const vi_flight *flight, const vi_point points[],
                             const int looked_for[], const vi_approach approach[], vi_search_found *found, bool *goes_on)
{
    const vi_flight_instant *now = &found->now;
    double step = flight->length - now->u;
    int nearest = -1, landing_on = -1;
    *goes_on = false;
    for (int k = 0; k < s->model->contacts; ++k) {
        if (!looked_for[k]) {
            continue;
        }
        const vi_approach *p = &approach[k];
        if (p->velocity > 0.0 && p->clearance <= VI_ROUNDING * points[k].scale) {
            return meet(found, k, landing_step(s->model, p), s->model->fastest);
        }
        const double seconds = vi_seconds_to_landing(p, s->model->fastest, points[k].scale);
        const double certified = vi_min(seconds, starts_on_stop(s, k, now->u)
                                                     ? vi_certified_step(p, step)
                                                     : vi_point_step(&points[k], flight, now, step));
        if (certified < step) {
            step = certified;
            nearest = k;
            landing_on = certified == seconds ? k : -1;
        }
    }
    if (nearest < 0) {
        found->u = flight->length;
        return VI_SEARCH_NOTHING;
    }
    if (landing_on >= 0 || now->u + step == now->u) {
        return meet(found, nearest, step, s->model->fastest);
    }
    found->u = now->u + step;
    *goes_on = true;
    return VI_SEARCH_NOTHING;
}

/* Scan onwards. True when this ends the search, with the result in *end; otherwise found->u is the time reached. */
static bool scan_on(const vi_structure *s, const vi_flight *flight, const vi_point points[], const int looked_for[],
                    const vi_approach approach[], vi_search_found *found, vi_search_end *end)
{
    vi_scan_found bracket;
    const vi_scan_end result = vi_scan_flight(s->scan, flight, points, looked_for, &found->now, approach, &bracket);
    vi_budget_spend(&s->state->budget, (int64_t)bracket.blocks * vi_structure_modes(s->model));
    *end = VI_SEARCH_NOTHING;
    found->u = result == VI_SCAN_CLEAR ? flight->length : bracket.low;
    if (result == VI_SCAN_BRACKET && close_in(s, flight, &points[bracket.contact], &bracket, found)) {
        *end = found->u < flight->length ? VI_SEARCH_CONTACT : VI_SEARCH_NOTHING;
        found->u = vi_min(found->u, flight->length);
        return true;
    }
    return result == VI_SCAN_CLEAR;
}

vi_search_end vi_search_flight(const vi_structure *s, const vi_flight *flight, const vi_point points[],
                               vi_search_found *found)
{
    vi_approach approach[VI_PORTS];
    int looked_for[VI_PORTS];
    const bool scans = s->scan != NULL && !flight->series && !s->model->varies && s->model->fastest > 0.0;
    int pause = 0; /* evaluations left before the next scan */
    for (int k = 0; k < s->model->contacts; ++k) {
        looked_for[k] = vi_structure_watched(s, k);
    }
    found->u = 0.0;
    for (int evaluation = 0; evaluation < VI_MOST_EVALUATIONS; ++evaluation) {
        vi_search_end end;
        bool goes_on;
        vi_budget_spend(&s->state->budget, vi_structure_modes(s->model));
        vi_flight_at(flight, found->u, &found->now);
        if (!look(s, flight, points, looked_for, &found->now, approach)) {
            return VI_SEARCH_BEYOND;
        }
        if (scans && pause-- == 0) {
            const double before = found->u;
            pause = PATIENCE;
            if (scan_on(s, flight, points, looked_for, approach, found, &end)) {
                return end;
            }
            if (found->u > before) {
                continue;
            }
        }
        end = step_on(s, flight, points, looked_for, approach, found, &goes_on);
        if (!goes_on) {
            return end;
        }
    }
    return VI_SEARCH_NOTHING;
}
