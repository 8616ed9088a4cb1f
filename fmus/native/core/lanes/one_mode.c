/* A body of one mode: its tables, and the motion of one lane of it. */
#include <float.h>
#include <math.h>
#include <stddef.h>

#include "body/landing.h"
#include "lanes/lane_body.h"
#include "lanes/lane_sines.h"
#include "lanes/lane_state.h"
#include "lanes/lane_tables.h"
#include "lanes/lane_turn.h"
#include "lanes/sampling.h"
#include "motion/majorant.h"

/* Largest steady response that counts in the resolution, in units of the force's effect within one radian. */
static const double LARGEST_STEADY = 8.0;
/* Length of a cell, in units of 1 / frequency of a further sine; the omitted Taylor terms are below 2e-17 of its motion. */
static const double SINE_REACH = 1.05;

/* ---- the state ---- */

/* The motion of q over the cell at the present instant, at which the last round starts. */
static vi_lane_cell present_cell(const vi_lane_group *g, int lane)
{
    const vi_lane_state start = {g->start_q[0][lane], g->start_p[0][lane], g->start_cosine[lane], g->start_sine[lane]};
    const vi_lane_phases phases = vi_lane_phases_at(g, lane, g->periods[lane], g->rest[lane]);
    vi_lane_cell cell = vi_lane_cell_from(&g->one, lane, &start, g->cell[lane]);
    vi_lane_cell_add_sines(&cell, g, lane, &phases);
    return cell;
}

/* ---- the careful search ---- */

/* The motion towards stop c. */
static vi_lane_cell towards(const vi_lane_group *g, int lane, int c, const vi_lane_cell *cell)
{
    vi_lane_cell motion = {.order = cell->order};
    for (int n = 0; n <= cell->order; ++n) {
        motion.term[n] = g->sign[c][lane] * cell->term[n];
    }
    motion.term[0] = g->on[lane] == c + 1 ? 0.0 : motion.term[0] - g->limit[c][lane];
    return motion;
}

static vi_cell_result search(vi_lane_group *g, int lane, int modes, int contacts, double *share, vi_lane_meeting *met)
{
    (void)modes;
    g->start_q[0][lane] = g->q[0][lane];
    g->start_p[0][lane] = g->p[0][lane];
    vi_lane_turn(g->angular_frequency[lane] * g->rest[lane], &g->start_cosine[lane], &g->start_sine[lane]);
    g->jumped[lane] = g->passed[lane] = 0.0;
    const vi_lane_cell cell = present_cell(g, lane);
    vi_cell_result result = VI_CELL_CLEAR;
    double slope;
    for (int c = 0; c < contacts; ++c) {
        const vi_lane_cell motion = towards(g, lane, c, &cell);
        const double scale = fabs(g->limit[c][lane]) + fabs(cell.term[0]) + fabs(cell.term[1]);
        const vi_cell_result one = vi_lane_cell_search(&motion, scale, share, &slope);
        if (one == VI_CELL_UNDECIDED) {
            return one;
        }
        if (one == VI_CELL_HIT) {
            *met = (vi_lane_meeting){c, slope * g->cell_rate[lane]};
            result = one;
        }
    }
    vi_lane_cell_at(&cell, *share, &g->q[0][lane], &slope);
    g->p[0][lane] = slope * g->cell_rate[lane];
    g->share[lane] = *share;
    return result;
}

static bool rebound(vi_lane_group *g, int lane, int modes, const vi_lane_meeting *met, double after)
{
    (void)modes;
    const double sign = g->sign[met->contact][lane];
    g->q[0][lane] = sign * g->limit[met->contact][lane];
    g->p[0][lane] = -sign * after;
    return met->approach * met->approach > g->resolution[met->contact][lane];
}

static void observe(vi_lane_group *g, int lane, int modes, int contacts, double *displacement, double *velocity)
{
    (void)modes;
    for (int c = 0; c < contacts; ++c) {
        if (g->sign[c][lane] * g->q[0][lane] > g->limit[c][lane]) {
            g->q[0][lane] = g->sign[c][lane] * g->limit[c][lane];
        }
    }
    *displacement = g->q[0][lane];
    *velocity = g->p[0][lane];
}

static void state(const vi_lane_group *g, int lane, const vi_lanes_plan *plan, double q[], double p[])
{
    (void)plan;
    q[0] = g->q[0][lane];
    p[0] = g->p[0][lane];
}

/* ---- the start ---- */

/* A contact of a point in units of the mode: it is free while sign q < limit. */
typedef struct {
    double number, sign, limit; /* number: from 1 */
} limited;

/* Put the nearest contact of each side first: a body of one mode meets no other. False where rounding decides which one
 * is the nearest. */
static bool order_contacts(int contacts, limited of[])
{
    for (int c = 1; c < contacts; ++c) {
        const limited moved = of[c];
        int place = c;
        for (; place > 0 && moved.limit < of[place - 1].limit; --place) {
            of[place] = of[place - 1];
        }
        of[place] = moved;
    }
    int other = 1;
    while (other < contacts - 1 && of[other].sign == of[0].sign) {
        other += 1;
    }
    const limited second = of[other];
    for (; other > 1; --other) {
        of[other] = of[other - 1];
    }
    of[1] = second;
    for (int c = 1; c < contacts; ++c) {
        const limited *nearest = &of[of[c].sign == of[0].sign ? 0 : 1];
        if (nearest != &of[c]
            && !(of[c].limit - nearest->limit > VI_ROUNDING * (fabs(of[c].limit) + fabs(nearest->limit)))) {
            return false;
        }
    }
    return true;
}

/* Set the contacts of a point; false where one is invalid, the start is not clear of it, or the stops leave no room. */
static bool take_contacts(vi_lane_group *g, int lane, int contacts, const vi_lanes_points *p, int64_t point, double size)
{
    limited of[VI_LANES_CONTACTS] = {{0.0, 0.0, 0.0}};
    for (int c = 0; c < contacts; ++c) {
        const int64_t i = c * p->count + point;
        of[c] = (limited){c + 1.0, p->shape[i] * p->direction[i] > 0.0 ? 1.0 : -1.0,
                          p->direction[i] * p->position[i] / fabs(p->shape[i])};
    }
    if (contacts > VI_ONE_MODE_CONTACTS && !order_contacts(contacts, of)) {
        return false;
    }
    for (int c = 0; c < contacts; ++c) {
        const int64_t i = ((int64_t)of[c].number - 1) * p->count + point;
        const double unit = fabs(p->shape[i]), sign = of[c].sign, limit = of[c].limit, q = g->q[0][lane];
        const double pressure = g->one.load[lane] + g->one.stiffness[lane] * fabs(limit);
        const bool is_free = limit - sign * q > VI_ROUNDING * (fabs(limit) + fabs(q));
        if (!vi_lane_is_contact(p, i) || !(p->shape[i] * p->impulse[i] > 0.0) || !isfinite(limit) || !is_free) {
            return false;
        }
        g->record.number[c][lane] = of[c].number;
        g->sign[c][lane] = sign;
        g->limit[c][lane] = limit;
        g->restitution[c][lane] = p->restitution[i];
        g->yield_velocity[c][lane] = p->yield_velocity[i] / unit;
        g->resolution[c][lane] = 2.0 * pressure * DBL_EPSILON * (fabs(limit) + size);
    }
    return contacts < 2 || of[0].sign == of[1].sign || of[0].limit + of[1].limit > 0.0;
}

/* Fill the tables for the further sines of a point; false for a force that is no number. */
static bool take_sines(vi_lane_group *g, int lane, const vi_lanes_points *points, int64_t point, double cell)
{
    for (int k = 0; k < vi_further_sines(g); ++k) {
        const vi_lane_mode mode = {points->stiffness[point], points->decay[point],
                                   points->further_force[k * points->count + point], 0.0,
                                   g->sines->angular_frequency[k][lane]};
        if (!isfinite(mode.force)) {
            return false;
        }
        vi_lane_sine_tables(&g->one, g->sines, k, lane, &mode, cell);
    }
    return true;
}

static bool take(vi_lane_group *g, int lane, const vi_lanes_plan *plan, const vi_lanes_points *points, int64_t point,
                 const double q[], const double p[])
{
    vi_one_mode *one = &g->one;
    const vi_lane_mode mode = {points->stiffness[point], points->decay[point], points->force[point],
                               points->held[point], points->angular_frequency[point]};
    const double natural = sqrt(mode.stiffness), drag = 2.0 * mode.decay, period = g->period[lane];
    const double fastest = vi_max(vi_max(natural, drag), mode.angular_frequency);
    double longest = vi_min(VI_CELL_REACH / fastest, VI_LONGEST_CELL * period);
    for (int k = 0; k < plan->further; ++k) {
        longest = vi_min(longest, SINE_REACH / g->sines->angular_frequency[k][lane]);
    }
    const double cell = vi_lane_cell_length(longest);
    if (!isfinite(mode.force) || !isfinite(mode.held) || !(cell > 0.0) || !(period <= VI_MOST_CELLS * cell)) {
        return false;
    }
    vi_lane_tables(one, lane, &mode, cell);
    vi_lane_pair_tables(one, lane, &mode, cell);
    if (!take_sines(g, lane, points, point, cell)) {
        return false;
    }
    g->cell[lane] = cell;
    g->cell_rate[lane] = 1.0 / cell;
    g->q[0][lane] = q[0];
    g->p[0][lane] = p[0];
    g->record.scale[lane] = points->observed[point];
    const double steady = LARGEST_STEADY * one->load[lane] / (fastest * fastest);
    return take_contacts(g, lane, plan->contacts, points, point, steady);
}

const vi_lane_body vi_lane_one_mode = {take,    search, rebound,             NULL,
                                            observe, state,  vi_lane_sample_from, vi_lane_take_samples};
