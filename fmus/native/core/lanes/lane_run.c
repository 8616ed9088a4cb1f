#include "lanes/lane_run.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "body/landing.h"
#include "body/record.h"
#include "contact/contact_law.h"
#include "door/runs.h"
#include "lanes/lane_cell.h"
#include "lanes/lane_tables.h"
#include "motion/majorant.h"

/* Length of a cell times the fastest rate: the Taylor terms that are left out are below 1e-17 of the first. */
static const double CELL_REACH = 0.35;
/* Cells in a period, beyond which a body has rates too far apart for lockstep. */
static const double MOST_CELLS = 4096.0;
/* The steady response counts in the resolution up to this multiple of what the force does within one radian. */
static const double LARGEST_STEADY = 8.0;

/* ---- the present instant ---- */

static vi_instant instant_of(const vi_lane_group *g, int lane)
{
    return (vi_instant){(int64_t)g->periods[lane], g->rest[lane], g->rest_low[lane]};
}

static void put_instant(vi_lane_group *g, int lane, vi_instant now)
{
    g->periods[lane] = (double)now.periods;
    g->rest[lane] = now.rest;
    g->rest_low[lane] = now.rest_low;
}

static double time_of(const vi_lanes_work *w, int lane)
{
    return vi_clock_time(&w->run[lane].clock, instant_of(w->group, lane));
}

/* ---- the rows ---- */

static void append(const vi_lanes_work *w, int lane, const double row[VI_RECORD_WIDTH])
{
    vi_lanes_points *p = w->points;
    memcpy(p->rows + p->rows_used * VI_RECORD_WIDTH, row, VI_RECORD_WIDTH * sizeof row[0]);
    p->owner[p->rows_used] = w->run[lane].point;
    p->rows_of[w->run[lane].point] += 1;
    p->rows_used += 1;
}

static void tell_impact(const vi_lanes_work *w, int lane)
{
    const vi_lane_group *g = w->group;
    const vi_lane_run *run = &w->run[lane];
    const int contact = (int)g->hit[lane] - 1;
    const double speed = g->approach[lane] * run->unit[contact];
    const vi_contact_law law = {.restitution = g->restitution[contact][lane],
                                .yield_velocity = g->yield_velocity[contact][lane] * run->unit[contact]};
    const double restitution = vi_contact_law_restitution(&law, speed);
    const double impulse = (1.0 + restitution) * speed * run->impulse[contact];
    const double row[] = {VI_ROW_IMPACT, time_of(w, lane), vi_clock_phase(&run->clock, instant_of(g, lane)), speed,
                          impulse, contact + 1.0, restitution, 0.0};
    append(w, lane, row);
}

/* A period begins: tell of the one that ends. */
static void turn_period(const vi_lanes_work *w, int lane)
{
    const vi_lane_group *g = w->group;
    vi_lane_run *run = &w->run[lane];
    if (run->period_open) {
        const double ends[2] = {run->observed * run->highest, run->observed * run->lowest};
        const bool extrema = w->plan->extrema != 0;
        const double row[] = {VI_ROW_PERIOD, run->period_start, extrema ? vi_max(ends[0], ends[1]) : NAN,
                              extrema ? vi_min(ends[0], ends[1]) : NAN, run->strobe_displacement,
                              run->strobe_velocity, g->impacts[lane] - run->impacts_before, 0.0};
        append(w, lane, row);
    }
    run->period_open = true;
    run->period_start = time_of(w, lane);
    run->strobe_displacement = run->observed * g->q[lane];
    run->strobe_velocity = run->observed * g->p[lane];
    run->impacts_before = g->impacts[lane];
    run->highest = run->lowest = g->q[lane];
}

/* ---- the goals of a run ---- */

/* What it flies to next: the end of a recorded period, or of a part of the run. */
static void set_goal(const vi_lanes_work *w, int lane)
{
    vi_lane_group *g = w->group;
    vi_lane_run *run = &w->run[lane];
    const vi_instant now = instant_of(g, lane);
    vi_instant goal = run->recording ? run->end : run->begin;
    run->goal_is_period = run->recording && w->plan->periods
                          && vi_clock_to_period_end(&run->clock, now) <= vi_clock_elapsed(&run->clock, now, goal);
    if (run->goal_is_period) {
        goal = (vi_instant){now.periods + 1, 0.0, 0.0};
    }
    g->goal_periods[lane] = (double)goal.periods;
    g->goal_rest[lane] = goal.rest;
    g->goal_rest_low[lane] = goal.rest_low;
}

static void leave(vi_lanes_work *w, int lane)
{
    const int64_t point = w->run[lane].point;
    w->points->state[point] = VI_POINT_IS_LEFT;
    w->points->rows_of[point] = 0;
    w->points->finished += 1;
    w->run[lane].point = -1;
}

/* The run has ended. */
static void finish(vi_lanes_work *w, int lane, int outcome, double reached)
{
    vi_lanes_points *p = w->points;
    const vi_lane_group *g = w->group;
    const vi_lane_run *run = &w->run[lane];
    const int64_t point = run->point;
    if (!isfinite(g->q[lane]) || !isfinite(g->p[lane])) {
        leave(w, lane);
        return;
    }
    p->outcome[point] = (int8_t)outcome;
    p->reached[point] = reached;
    p->final_q[point] = g->q[lane];
    p->final_p[point] = g->p[lane];
    p->displacement[point] = run->observed * g->q[lane];
    p->velocity[point] = run->observed * g->p[lane];
    p->state[point] = VI_POINT_HAS_RUN;
    p->finished += 1;
    w->run[lane].point = -1;
    w->run[lane].following = point + 1;
}

/* At an instant that is no contact's: begin to record, turn the period, end. */
static void arrive(vi_lanes_work *w, int lane)
{
    vi_lane_group *g = w->group;
    vi_lane_run *run = &w->run[lane];
    for (int c = 0; c < w->plan->contacts; ++c) { /* it is not beyond a stop but for rounding */
        if (g->sign[c][lane] * g->q[lane] > g->limit[c][lane]) {
            g->q[lane] = g->sign[c][lane] * g->limit[c][lane];
        }
    }
    if (run->goal_is_period) {
        turn_period(w, lane);
    }
    if (!run->recording) {
        run->recording = true;
        run->period_open = false;
        g->tells[lane] = w->plan->impacts ? 1.0 : 0.0;
        g->follows[lane] = w->plan->periods && w->plan->extrema ? 1.0 : 0.0;
        run->highest = run->lowest = g->q[lane];
        if (w->plan->periods && g->rest[lane] == 0.0) {
            turn_period(w, lane);
        }
    }
    if (vi_clock_elapsed(&run->clock, instant_of(g, lane), run->end) > 0.0) {
        set_goal(w, lane);
    } else {
        finish(w, lane, VI_RUN_ENDED, w->points->end[run->point]);
    }
}

/* An impact that is told: its row, and the limit. */
static void hit(vi_lanes_work *w, int lane)
{
    vi_lane_group *g = w->group;
    if (w->run[lane].recording && w->plan->impacts) {
        tell_impact(w, lane);
    }
    const bool over = vi_clock_elapsed(&w->run[lane].clock, instant_of(g, lane), w->run[lane].end) > 0.0;
    if (over && g->impacts[lane] >= g->most_impacts[lane]) {
        finish(w, lane, VI_RUN_IMPACT_LIMIT, time_of(w, lane));
    }
}

/* ---- the careful search ---- */

/* Move the lane to the place of its cell that it has been followed to. */
static void move_in_cell(const vi_lanes_work *w, int lane, double share)
{
    vi_lane_group *g = w->group;
    const vi_clock *clock = &w->run[lane].clock;
    const int passed = (int)g->passed[lane];
    const vi_lane_cell cell = vi_lane_cell_after(g, lane, passed);
    double slope;
    vi_lane_cell_at(&cell, share, &g->q[lane], &slope);
    g->p[lane] = slope * g->cell_rate[lane];
    g->share[lane] = share;
    g->on[lane] = 0.0;
    const vi_instant whole = vi_clock_after(clock, instant_of(g, lane), passed * g->cell[lane]);
    put_instant(g, lane, vi_clock_after(clock, whole, share * g->cell[lane]));
}

/* The rebound, as in lockstep. Returns the event. */
static int bounce(const vi_lanes_work *w, int lane, int contact, double approach)
{
    vi_lane_group *g = w->group;
    const vi_contact_law law = {.restitution = g->restitution[contact][lane],
                                .yield_velocity = g->yield_velocity[contact][lane]};
    const double after = vi_contact_law_restitution(&law, approach) * approach;
    g->fastest_impact[lane] = vi_max(g->fastest_impact[lane], approach);
    if (!(after > 1e-4 * g->fastest_impact[lane]) || !(approach * approach > g->resolution[contact][lane])) {
        return VI_EVENT_LEAVE;
    }
    g->q[lane] = g->sign[contact][lane] * g->limit[contact][lane];
    g->p[lane] = -g->sign[contact][lane] * after;
    g->on[lane] = g->hit[lane] = contact + 1.0;
    g->approach[lane] = approach;
    g->impacts[lane] += 1.0;
    const bool tells = g->tells[lane] > 0.0 || g->impacts[lane] >= g->most_impacts[lane];
    return tells ? VI_EVENT_IMPACT : VI_EVENT_NONE;
}

/* Search the cell that lockstep could not decide. Returns the event that it comes to. */
static int search(const vi_lanes_work *w, int lane)
{
    vi_lane_group *g = w->group;
    const vi_instant now = instant_of(g, lane);
    const vi_instant goal = {(int64_t)g->goal_periods[lane], g->goal_rest[lane], g->goal_rest_low[lane]};
    const double length = vi_clock_elapsed(&w->run[lane].clock, now, goal) * g->cell_rate[lane] - g->passed[lane];
    double share = vi_max(0.0, vi_min(length, 1.0)), approach = 0.0;
    int contact = 0;
    const vi_cell_result result = vi_lane_cell_search(g, lane, w->plan->contacts, &share, &contact, &approach);
    if (result == VI_CELL_UNDECIDED) {
        return VI_EVENT_LEAVE;
    }
    move_in_cell(w, lane, share);
    if (result == VI_CELL_HIT) {
        return bounce(w, lane, contact, approach);
    }
    if (length <= 1.0) {
        put_instant(g, lane, goal);
        return VI_EVENT_GOAL;
    }
    return VI_EVENT_NONE;
}

void vi_lane_attend(vi_lanes_work *w, int lane)
{
    vi_lane_group *g = w->group;
    int event = (int)g->event[lane];
    if (event == VI_EVENT_NONE) {
        return;
    }
    if (event == VI_EVENT_CELL) {
        event = search(w, lane);
    }
    if (event != VI_EVENT_LEAVE && g->follows[lane] > 0.0) {
        vi_lane_extremes(g, lane, w->plan->contacts, &w->run[lane].highest, &w->run[lane].lowest);
    }
    if (event == VI_EVENT_LEAVE) {
        leave(w, lane);
    } else if (event == VI_EVENT_GOAL) {
        arrive(w, lane);
    } else if (event == VI_EVENT_IMPACT) {
        hit(w, lane);
    }
}

/* ---- the start ---- */

void vi_lane_idle(vi_lanes_work *w, int lane)
{
    vi_lane_group *g = w->group;
    const vi_lane_mode nothing = {0.0, 0.0, 0.0, 0.0, 0.0};
    vi_lane_tables(g, lane, &nothing, 1.0);
    w->run[lane].point = -1;
    g->q[lane] = g->p[lane] = g->on[lane] = g->rest[lane] = g->rest_low[lane] = g->periods[lane] = 0.0;
    g->stiffness[lane] = g->load[lane] = g->drag[lane] = g->root_rate[lane] = g->angular_frequency[lane] = 0.0;
    g->cell[lane] = g->period_low[lane] = g->tells[lane] = g->follows[lane] = 0.0;
    g->cell_rate[lane] = g->period[lane] = 1.0;
    g->goal_periods[lane] = 1e300;
    g->goal_rest[lane] = g->goal_rest_low[lane] = 0.0;
    g->most_impacts[lane] = HUGE_VAL;
    for (int c = 0; c < VI_LANES_CONTACTS; ++c) {
        g->sign[c][lane] = g->limit[c][lane] = 1.0;
    }
}

/* The contacts of a point; false where one is none, or the start is not free of it. */
static bool take_contacts(const vi_lanes_work *w, int lane, int64_t point, double natural_size)
{
    const vi_lanes_points *p = w->points;
    vi_lane_group *g = w->group;
    double room = 0.0;
    for (int c = 0; c < w->plan->contacts; ++c) {
        const int64_t i = c * p->count + point;
        const double shape = p->shape[i], mobility = shape * p->impulse[i];
        const double unit = fabs(shape), sign = shape * p->direction[i] > 0.0 ? 1.0 : -1.0;
        const bool good = mobility > 0.0 && isfinite(mobility) && fabs(p->direction[i]) == 1.0
                          && isfinite(p->position[i]) && p->restitution[i] >= 0.0 && p->restitution[i] <= 1.0
                          && p->yield_velocity[i] >= 0.0 && isfinite(p->yield_velocity[i]);
        const double limit = p->direction[i] * p->position[i] / unit;
        const double size = fabs(limit) + natural_size, pressure = g->load[lane] + g->stiffness[lane] * fabs(limit);
        if (!good || !(limit - sign * g->q[lane] > VI_ROUNDING * (fabs(limit) + fabs(g->q[lane])))) {
            return false;
        }
        room += c == 0 || sign != g->sign[0][lane] ? limit : HUGE_VAL;
        g->sign[c][lane] = sign;
        g->limit[c][lane] = limit;
        g->restitution[c][lane] = p->restitution[i];
        g->yield_velocity[c][lane] = p->yield_velocity[i] / unit;
        g->resolution[c][lane] = 2.0 * pressure * DBL_EPSILON * size;
        w->run[lane].unit[c] = unit;
        w->run[lane].impulse[c] = 1.0 / mobility;
    }
    return w->plan->contacts < 2 || room > 0.0;
}

/* Its clock and the window of its recording; false where they are none. */
static bool take_time(const vi_lanes_work *w, int lane, int64_t point, double natural)
{
    const vi_lanes_points *p = w->points;
    vi_lane_run *run = &w->run[lane];
    const double frequency = p->angular_frequency[point], phase = p->phase[point];
    vi_instant start;
    if (!(frequency >= 0.0) || !isfinite(frequency) || !isfinite(phase) || !(p->begin[point] >= 0.0)
        || !(p->end[point] >= p->begin[point]) || !isfinite(p->end[point])
        || !vi_clock_start(&run->clock, frequency, phase, natural) || !vi_clock_instant(&run->clock, 0.0, 0.0, &start)
        || !vi_clock_instant(&run->clock, p->begin[point], 0.0, &run->begin)
        || !vi_clock_instant(&run->clock, p->end[point], 0.0, &run->end)) {
        return false;
    }
    put_instant(w->group, lane, start);
    w->group->period[lane] = run->clock.period;
    w->group->period_low[lane] = run->clock.period_low;
    return true;
}

/* A length of cells whose multiples up to VI_CELLS are exact. */
static double cell_length(double longest)
{
    const double coarse = longest * 256.0;
    return (longest + coarse) - coarse;
}

/* The mode and its tables; false where lockstep does not follow it. */
static bool take_mode(const vi_lanes_work *w, int lane, int64_t point)
{
    const vi_lanes_points *p = w->points;
    vi_lane_group *g = w->group;
    const vi_lane_mode mode = {p->stiffness[point], p->decay[point], p->force[point], p->held[point],
                               p->angular_frequency[point]};
    const double natural = sqrt(mode.stiffness);
    const bool good = mode.stiffness > 0.0 && isfinite(natural) && mode.decay >= 0.0 && isfinite(mode.decay)
                      && isfinite(mode.force) && isfinite(mode.held) && isfinite(p->observed[point]);
    if (!good || !take_time(w, lane, point, natural)) {
        return false;
    }
    const double fastest = vi_max(vi_max(natural, 2.0 * mode.decay), mode.angular_frequency);
    const double period = w->run[lane].clock.period;
    const double longest = vi_min(CELL_REACH / fastest, period / (2 * VI_CELLS)), cell = cell_length(longest);
    if (!(cell > 0.0) || !(period <= MOST_CELLS * cell)) {
        return false;
    }
    vi_lane_tables(g, lane, &mode, cell);
    g->cell[lane] = cell;
    g->cell_rate[lane] = 1.0 / cell;
    g->span[lane] = (double)VI_CELLS * cell;
    g->stiffness[lane] = mode.stiffness;
    g->angular_frequency[lane] = mode.angular_frequency;
    g->load[lane] = fabs(mode.force) + fabs(mode.held);
    g->drag[lane] = 2.0 * mode.decay;
    g->root_rate[lane] = 2.0 * mode.decay + natural;
    return take_contacts(w, lane, point, LARGEST_STEADY * g->load[lane] / (fastest * fastest));
}

/* Where a point starts: its own start, or where the last one before it on its branch that came to its end has ended. */
static bool take_start(const vi_lanes_work *w, int lane, int64_t point)
{
    const vi_lanes_points *p = w->points;
    vi_lane_group *g = w->group;
    if (point == 0 || p->first[point]) {
        g->q[lane] = p->start_q[point];
        g->p[lane] = p->start_p[point];
        return isfinite(g->q[lane]) && isfinite(g->p[lane]);
    }
    int64_t before = point - 1;
    while (before > 0 && !p->first[before] && p->outcome[before] != VI_RUN_ENDED) {
        before -= 1;
    }
    g->q[lane] = p->final_q[before];
    g->p[lane] = p->final_p[before];
    return p->outcome[before] == VI_RUN_ENDED && isfinite(g->q[lane]) && isfinite(g->p[lane]);
}

/* Begin a point in a lane; one may be left, or end, at once. */
static void begin_point(vi_lanes_work *w, int lane, int64_t point)
{
    vi_lane_group *g = w->group;
    vi_lane_run *run = &w->run[lane];
    run->point = point;
    run->observed = w->points->observed[point];
    run->recording = run->goal_is_period = run->period_open = false;
    w->points->rows_of[point] = 0;
    g->on[lane] = g->fastest_impact[lane] = g->impacts[lane] = g->tells[lane] = g->follows[lane] = 0.0;
    g->most_impacts[lane] = w->plan->impact_limit > 0 ? (double)w->plan->impact_limit : HUGE_VAL;
    if (!take_start(w, lane, point) || !take_mode(w, lane, point)) {
        leave(w, lane);
        return;
    }
    w->points->state[point] = VI_POINT_RUNS;
    if (vi_clock_elapsed(&run->clock, instant_of(g, lane), run->begin) > 0.0) {
        set_goal(w, lane);
    } else {
        arrive(w, lane);
    }
}

static bool can_begin(const vi_lanes_points *p, int64_t point)
{
    if (point >= p->count || p->state[point] != VI_POINT_WAITS) {
        return false;
    }
    const uint8_t before = point == 0 || p->first[point] ? VI_POINT_HAS_RUN : p->state[point - 1];
    return before == VI_POINT_HAS_RUN || before == VI_POINT_IS_ANSWERED;
}

bool vi_lane_take(vi_lanes_work *w, int lane)
{
    const int64_t following = w->run[lane].following;
    if (can_begin(w->points, following)) { /* of the branch that the lane is on */
        begin_point(w, lane, following);
        return true;
    }
    for (; w->next < w->points->count; ++w->next) {
        if (can_begin(w->points, w->next)) {
            begin_point(w, lane, w->next);
            return true;
        }
    }
    return false;
}
