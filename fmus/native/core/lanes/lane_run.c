#include "lanes/lane_run.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "contact/contact_law.h"
#include "door/runs.h"
#include "lanes/lane_record.h"
#include "lanes/lane_sines.h"
#include "lanes/sampling.h"
#include "lanes/yielding.h"
#include "motion/majorant.h"

/* Least stiffness of a spring and, its reciprocal, largest stiffness and decay. Squares of rates and of cells stay in
 * range. */
static const double LEAST = 1e-60;

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

/* ---- the goals of a run ---- */

/* Do the flights of the lanes wait for the record of their periods? */
static bool flights_wait(const vi_lanes_work *w)
{
    return w->plan->periods && w->body->extremes == NULL;
}

/* Set the next goal of the flight: the end of a recorded period, or of a part of the run. */
static void set_goal(const vi_lanes_work *w, int lane)
{
    vi_lane_group *g = w->group;
    vi_lane_run *run = &w->run[lane];
    const vi_instant now = instant_of(g, lane);
    vi_instant goal = run->recording ? run->end : run->begin;
    run->goal_is_period = run->recording && w->plan->periods && !flights_wait(w)
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
    w->points->rows_of[point] = w->points->periods_of[point] = 0;
    if (w->plan->rate > 0.0) {
        w->points->samples_of[point] = 0;
    }
    w->points->finished += 1;
    w->run[lane].point = -1;
}

/* End the run, with its results. */
static void finish(vi_lanes_work *w, int lane, int outcome, double reached)
{
    vi_lanes_points *points = w->points;
    const int64_t point = w->run[lane].point;
    double q[VI_LANES_MODES], p[VI_LANES_MODES], displacement, velocity;
    vi_lane_record_waiting(w->group, w->plan, points, lane);
    w->body->observe(w->group, lane, vi_real_modes(w->plan), w->plan->contacts, &displacement, &velocity);
    w->body->state(w->group, lane, w->plan, q, p);
    if (!isfinite(displacement) || !isfinite(velocity)) {
        leave(w, lane);
        return;
    }
    if (!w->plan->each_period && points->periods_of[point] > 0) {
        const int64_t place = (VI_OF_IMPACTS * points->count + point) * points->most_periods;
        points->periods[place] /= (double)points->periods_of[point];
    }
    vi_yielding_write_open(w->group, points, lane);
    points->outcome[point] = (int8_t)outcome;
    points->reached[point] = reached;
    points->displacement[point] = w->group->record.scale[lane] * displacement;
    points->velocity[point] = w->group->record.scale[lane] * velocity;
    for (int j = 0; j < w->plan->modes; ++j) {
        points->final_q[j * points->count + point] = q[j];
        points->final_p[j * points->count + point] = p[j];
    }
    points->state[point] = VI_POINT_HAS_RUN;
    points->finished += 1;
    w->run[lane].point = -1;
    w->run[lane].following = point + 1;
}

/* A period begins, and the open one ends. */
static void turn_period(const vi_lanes_work *w, int lane, double displacement, double velocity)
{
    vi_lane_record *record = &w->group->record;
    if (record->open[lane] > 0.0) {
        vi_lane_end_period(w->group, w->plan, w->points, lane);
    }
    record->open[lane] = 1.0;
    record->turn[lane] = w->group->periods[lane];
    record->last_turn[lane] = (double)w->run[lane].end.periods;
    vi_lane_begin_period(w->group, lane, displacement, velocity);
}

/* Act at an instant without contact: begin to record, turn the period, or end. */
static void arrive(vi_lanes_work *w, int lane)
{
    vi_lane_group *g = w->group;
    vi_lane_run *run = &w->run[lane];
    double displacement, velocity;
    w->body->observe(g, lane, vi_real_modes(w->plan), w->plan->contacts, &displacement, &velocity);
    if (run->goal_is_period) {
        turn_period(w, lane, displacement, velocity);
    }
    if (!run->recording) {
        run->recording = true;
        g->record.impacts[lane] = w->plan->impacts ? 1.0 : 0.0;
        g->record.extremes[lane] = w->plan->periods && w->plan->extrema ? 1.0 : 0.0;
        g->record.waits[lane] = flights_wait(w) ? 1.0 : 0.0;
        g->record.last_turn[lane] = flights_wait(w) ? (double)run->end.periods : -1.0;
        g->waiting[lane].flights = g->waiting[lane].strobes = 0;
        vi_lane_begin_period(g, lane, displacement, velocity);
        if (w->plan->periods && g->rest[lane] == 0.0) {
            turn_period(w, lane, displacement, velocity);
        }
        if (w->plan->rate > 0.0) {
            if (!vi_lane_begin_samples(g, w->plan, w->points, lane)) {
                leave(w, lane);
                return;
            }
            w->body->sample_from(g, lane, vi_real_modes(w->plan));
            w->body->take_samples(g, w->plan, w->points, lane);
        }
    }
    if (vi_clock_elapsed(&run->clock, instant_of(g, lane), run->end) > 0.0) {
        set_goal(w, lane);
    } else {
        finish(w, lane, VI_RUN_ENDED, w->points->end[run->point]);
    }
}

/* Act on the impact at the limit: the run ends, unless the impact is at its end. */
static void stop_at_limit(vi_lanes_work *w, int lane)
{
    const vi_clock *clock = &w->run[lane].clock;
    const vi_instant now = instant_of(w->group, lane);
    if (vi_clock_elapsed(clock, now, w->run[lane].end) > 0.0) {
        finish(w, lane, VI_RUN_IMPACT_LIMIT, vi_clock_time(clock, now));
    }
}

/* ---- the careful search ---- */

/* Rebound as in lockstep. Returns the event. */
static int bounce(const vi_lanes_work *w, int lane, const vi_lane_meeting *met)
{
    vi_lane_group *g = w->group;
    const int c = met->contact;
    const vi_contact_law law = {.restitution = g->restitution[c][lane], .yield_velocity = g->yield_velocity[c][lane]};
    const double after = vi_contact_law_restitution(&law, met->approach) * met->approach;
    g->fastest_impact[lane] = vi_max(g->fastest_impact[lane], met->approach);
    if (!w->body->rebound(g, lane, vi_real_modes(w->plan), met, after)
        || !(after > VI_LANE_TAIL * g->fastest_impact[lane])) {
        return VI_EVENT_LEAVE;
    }
    g->on[lane] = g->hit[lane] = c + 1.0;
    g->approach[lane] = met->approach;
    g->impacts[lane] += 1.0;
    if (g->record.impacts[lane] > 0.0) {
        vi_lane_write_impact(g, w->plan, w->points, lane);
    }
    return g->impacts[lane] >= g->most_impacts[lane] ? VI_EVENT_IMPACT : VI_EVENT_NONE;
}

/* Search the cell that lockstep could not decide. Returns the resulting event. */
static int search(const vi_lanes_work *w, int lane)
{
    vi_lane_group *g = w->group;
    const vi_clock *clock = &w->run[lane].clock;
    const vi_instant now = instant_of(g, lane);
    const vi_instant goal = {(int64_t)g->goal_periods[lane], g->goal_rest[lane], g->goal_rest_low[lane]};
    const double length = vi_clock_elapsed(clock, now, goal) * g->cell_rate[lane];
    double share = vi_max(0.0, vi_min(length, 1.0)), cell = g->cell[lane];
    vi_lane_meeting met;
    const vi_cell_result result = w->body->search(g, lane, vi_real_modes(w->plan), w->plan->contacts, &share, &met);
    if (result == VI_CELL_UNDECIDED) {
        return VI_EVENT_LEAVE;
    }
    g->on[lane] = result == VI_CELL_ACTED ? g->on[lane] : 0.0;
    if (result == VI_CELL_CLEAR && length <= 1.0) {
        put_instant(g, lane, goal);
        return VI_EVENT_GOAL;
    }
    put_instant(g, lane, vi_clock_after(clock, now, share * cell));
    if (result == VI_CELL_ACTED) {
        return vi_yielding_record(g, w->points, lane);
    }
    return result == VI_CELL_HIT ? bounce(w, lane, &met) : VI_EVENT_NONE;
}

void vi_lane_attend(vi_lanes_work *w, int lane)
{
    vi_lane_group *g = w->group;
    int event = (int)g->event[lane];
    if (event == VI_EVENT_NONE) {
        return;
    }
    if (g->record.doubtful[lane] > 0.0) {
        w->body->extremes(g, lane, vi_real_modes(w->plan), w->plan->contacts);
    }
    if (event == VI_EVENT_CELL) {
        if (w->plan->rate > 0.0) {
            w->body->sample_from(g, lane, vi_real_modes(w->plan));
        }
        const bool waits = g->record.waits[lane] > 0.0;
        if (waits) {
            vi_lane_note_start(g, lane);
        }
        event = search(w, lane);
        if (waits && event != VI_EVENT_LEAVE) {
            vi_lane_note_flight(g, w->plan, w->points, lane);
        }
        if (event != VI_EVENT_LEAVE && w->plan->rate > 0.0) {
            w->body->take_samples(g, w->plan, w->points, lane);
        }
        if (event != VI_EVENT_LEAVE && !waits && g->record.extremes[lane] > 0.0) {
            w->body->extremes(g, lane, vi_real_modes(w->plan), w->plan->contacts);
        }
    }
    if (event == VI_EVENT_LEAVE) {
        leave(w, lane);
    } else if (event == VI_EVENT_GOAL) {
        arrive(w, lane);
    } else if (event == VI_EVENT_IMPACT) {
        stop_at_limit(w, lane);
    }
}

/* ---- the start ---- */

void vi_lane_idle(vi_lanes_work *w, int lane)
{
    double *all = (double *)w->group; /* all arrays over the lanes */
    for (size_t i = (size_t)lane; i < offsetof(vi_lane_group, waiting) / sizeof *all; i += VI_LANES) {
        all[i] = 0.0;
    }
    vi_lane_group *g = w->group;
    if (g->sines != NULL) {
        double *of_sines = (double *)g->sines;
        for (size_t i = (size_t)lane; i < offsetof(vi_lane_sines, count) / sizeof *of_sines; i += VI_LANES) {
            of_sines[i] = 0.0;
        }
    }
    w->run[lane].point = -1;
    g->cell_rate[lane] = g->period[lane] = g->many.present.rate[lane] = g->yielding.cell_rate[0][lane] = 1.0;
    g->goal_periods[lane] = 1e300;
    g->most_impacts[lane] = HUGE_VAL;
    for (int c = 0; c < VI_LANES_CONTACTS; ++c) {
        g->limit[c][lane] = 1.0;
        g->many.offset[c][lane] = -1.0;
    }
}

/* Set the clock and the window of the recording; false where they are invalid. */
static bool take_time(const vi_lanes_work *w, int lane, int64_t point)
{
    const vi_lanes_points *p = w->points;
    vi_lane_run *run = &w->run[lane];
    const double frequency = p->angular_frequency[point], phase = p->phase[point];
    vi_instant start;
    if (!(frequency >= 0.0) || !isfinite(frequency) || !isfinite(phase) || !(p->begin[point] >= 0.0)
        || !(p->end[point] >= p->begin[point]) || !isfinite(p->end[point])
        || !vi_clock_start(&run->clock, frequency, phase, sqrt(p->stiffness[point]))
        || !vi_clock_instant(&run->clock, 0.0, 0.0, &start)
        || !vi_clock_instant(&run->clock, p->begin[point], 0.0, &run->begin)
        || !vi_clock_instant(&run->clock, p->end[point], 0.0, &run->end)
        || !vi_lane_take_sines(w->group, lane, p, point, &run->clock, run->end.periods)
        || (w->plan->periods && w->plan->each_period && run->end.periods - run->begin.periods > p->most_periods)) {
        return false;
    }
    put_instant(w->group, lane, start);
    w->group->angular_frequency[lane] = frequency;
    w->group->period[lane] = run->clock.period;
    w->group->period_low[lane] = run->clock.period_low;
    w->group->record.origin[lane] = run->clock.origin;
    w->group->record.origin_low[lane] = run->clock.origin_low;
    return true;
}

/* Can a lane follow these springs and dashpots? */
static bool take_modes(const vi_lanes_work *w, int64_t point)
{
    const vi_lanes_points *p = w->points;
    for (int j = 0; j < w->plan->modes; ++j) {
        const int64_t i = j * p->count + point;
        const bool has_range = p->stiffness[i] == 0.0 || (p->stiffness[i] > LEAST && p->stiffness[i] < 1.0 / LEAST);
        if (!has_range || !(p->decay[i] >= 0.0) || !(p->decay[i] < 1.0 / LEAST) || !isfinite(p->observed[i])) {
            return false;
        }
    }
    return true;
}

/* Find the start state of a point: its own, or the final state of the last ended point of its branch. */
static bool take_start(const vi_lanes_work *w, int64_t point, double q[], double p[])
{
    const vi_lanes_points *points = w->points;
    const bool own = point == 0 || points->first[point];
    int64_t from = own ? point : point - 1;
    while (!own && from > 0 && !points->first[from] && points->outcome[from] != VI_RUN_ENDED) {
        from -= 1;
    }
    bool good = own || points->outcome[from] == VI_RUN_ENDED;
    for (int j = 0; j < w->plan->modes; ++j) {
        const int64_t i = j * points->count + from;
        q[j] = own ? points->start_q[i] : points->final_q[i];
        p[j] = own ? points->start_p[i] : points->final_p[i];
        good = good && isfinite(q[j]) && isfinite(p[j]);
    }
    return good;
}

/* Set the units of speeds and impulses of the contacts. */
static void take_units(const vi_lanes_work *w, int lane, int64_t point)
{
    const vi_lanes_points *p = w->points;
    vi_lane_record *record = &w->group->record;
    for (int c = 0; c < w->plan->contacts; ++c) {
        const int64_t contact = (int64_t)record->number[c][lane] - 1;
        double mobility = 0.0;
        for (int j = 0; j < w->plan->modes; ++j) {
            const int64_t i = (contact * w->plan->modes + j) * p->count + point;
            mobility += p->shape[i] * p->impulse[i];
        }
        record->impulse[c][lane] = 1.0 / mobility;
        record->unit[c][lane] = w->plan->modes == 1 ? fabs(p->shape[contact * p->count + point]) : 1.0;
    }
}

/* Begin a point in a lane; the point may be left, or end, at once. */
static void begin_point(vi_lanes_work *w, int lane, int64_t point)
{
    vi_lane_group *g = w->group;
    vi_lane_run *run = &w->run[lane];
    double q[VI_LANES_MODES], p[VI_LANES_MODES];
    run->point = point;
    w->group->samples.next[lane] = w->group->samples.count[lane] = 0.0;
    run->recording = run->goal_is_period = false;
    w->points->rows_of[point] = w->points->periods_of[point] = 0;
    if (w->plan->rate > 0.0) {
        w->points->samples_of[point] = 0;
    }
    g->on[lane] = g->fastest_impact[lane] = g->impacts[lane] = 0.0;
    g->hit_pairs[lane] = -1.0;
    g->record.impacts[lane] = g->record.extremes[lane] = g->record.doubtful[lane] = 0.0;
    g->record.waits[lane] = g->record.open[lane] = 0.0;
    g->record.last_turn[lane] = -1.0;
    g->record.point[lane] = (double)point;
    g->record.scale[lane] = 1.0;
    g->most_impacts[lane] = w->plan->impact_limit > 0 ? (double)w->plan->impact_limit : HUGE_VAL;
    for (int c = 0; c < w->plan->contacts; ++c) {
        g->record.number[c][lane] = c + 1.0;
    }
    if (!take_start(w, point, q, p) || !take_modes(w, point) || !take_time(w, lane, point)
        || !w->body->take(g, lane, w->plan, w->points, point, q, p)) {
        leave(w, lane);
        return;
    }
    take_units(w, lane, point);
    w->points->state[point] = VI_POINT_RUNS;
    if (vi_clock_elapsed(&run->clock, instant_of(g, lane), run->begin) > 0.0) {
        set_goal(w, lane);
    } else {
        arrive(w, lane);
    }
}

static bool can_begin(const vi_lanes_points *p, int64_t point)
{
    if (point >= p->begun_below || p->state[point] != VI_POINT_WAITS) {
        return false;
    }
    const uint8_t before = point == 0 || p->first[point] ? VI_POINT_HAS_RUN : p->state[point - 1];
    return before == VI_POINT_HAS_RUN || before == VI_POINT_IS_ANSWERED;
}

bool vi_lane_take(vi_lanes_work *w, int lane)
{
    const int64_t following = w->run[lane].following;
    if (can_begin(w->points, following)) { /* on the lane's own branch */
        begin_point(w, lane, following);
        return true;
    }
    for (; w->next < w->points->begun_below; ++w->next) {
        if (can_begin(w->points, w->next)) {
            begin_point(w, lane, w->next);
            return true;
        }
    }
    return false;
}
