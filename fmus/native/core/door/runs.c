#include "door/runs.h"

#include <math.h>

#include "body/record.h"
#include "door/seconds.h"
#include "door/status.h"

enum { NOT_BEGUN = 0, BEFORE_RECORDING = 1, RECORDING = 2, AT_END = 3 };
/* Results of a part of a run, besides VI_RUNS_*. */
enum { GO_ON = 0, RUN_ENDS = -1 };

/* Start where the previous run ended; a body beyond a stop that has moved starts on this stop at rest. */
static void carry(const vi_runs_plan *plan, const double carried[2], double values[])
{
    double displacement = carried[0], velocity = carried[1];
    for (int k = 0; k < plan->stops; ++k) {
        const double position = values[plan->stop_position[k]];
        if (plan->stop_direction[k] * (displacement - position) > 0.0) {
            displacement = position;
            velocity = 0.0;
        }
    }
    values[plan->displacement] = displacement;
    values[plan->velocity] = velocity;
    if (plan->phase >= 0) {
        values[plan->phase] = 0.0;
    }
}

static int begin(const vi_runs_fmu *f, const vi_runs_plan *plan, vi_runs_points *p)
{
    double *values = p->values + (size_t)p->at * (size_t)plan->columns;
    if (plan->chained && !p->first[p->at]) {
        if (!p->has_carried) {
            return VI_RUNS_REFUSED;
        }
        carry(plan, p->carried, values);
    } else {
        p->has_carried = 0;
    }
    for (int k = 0; k < plan->columns; ++k) {
        plan->elements[plan->places[k]] = values[k];
    }
    const uint64_t logged = f->log->count;
    const bool good =
        vi_status_is_good(f->reset(f->instance))
        && vi_status_is_good(f->set_float64(f->instance, plan->parameters.references, plan->parameters.count,
                                            plan->elements, plan->size))
        && (plan->integers.count == 0
            || vi_status_is_good(f->set_int64(f->instance, plan->integers.references, plan->integers.count,
                                      plan->integer_values, plan->integers.count)))
        && (plan->booleans.count == 0
            || vi_status_is_good(f->set_boolean(f->instance, plan->booleans.references, plan->booleans.count,
                                        plan->boolean_values, plan->booleans.count)))
        && vi_status_is_good(f->enter_initialization(f->instance, false, 0.0, 0.0, false, 0.0))
        && vi_status_is_good(f->exit_initialization(f->instance)) && f->log->count == logged;
    p->time = p->spent = 0.0;
    p->rows_of[p->at] = 0;
    p->stage = BEFORE_RECORDING;
    return good ? GO_ON : VI_RUNS_REFUSED;
}

/* Take the rows recorded by the body. */
static int take_rows(const vi_runs_fmu *f, const vi_runs_plan *plan, vi_runs_points *p)
{
    if (p->rows_room - p->rows_used < plan->row_capacity) {
        return VI_RUNS_FULL;
    }
    int64_t count = 0;
    if (!vi_status_is_good(f->get_int64(f->instance, &plan->record_count, 1, &count, 1))) {
        return VI_RUNS_REFUSED;
    }
    if (count == 0) {
        return GO_ON;
    }
    double *rows = p->rows + p->rows_used * VI_RECORD_WIDTH;
    const size_t size = (size_t)plan->row_capacity * VI_RECORD_WIDTH;
    if (!vi_status_is_good(f->get_float64(f->instance, &plan->record_rows, 1, rows, size))
        || !vi_status_is_good(f->set_int64(f->instance, &plan->record_taken, 1, &count, 1))) {
        return VI_RUNS_REFUSED;
    }
    p->rows_used += count;
    p->rows_of[p->at] += count;
    return GO_ON;
}

/* Make one step towards `end`; RUN_ENDS where the run has reached its limit. */
static int step(const vi_runs_fmu *f, vi_runs_points *p, double end)
{
    bool needs_event = false, ends = false, early = false;
    double reached = p->time;
    const int status =
        f->step(f->instance, p->time, end - p->time, false, &needs_event, &ends, &early, &reached);
    if (ends || (status != VI_STATUS_DISCARD && (!vi_status_is_good(status) || needs_event))) {
        return VI_RUNS_REFUSED;
    }
    if (status == VI_STATUS_DISCARD) {
        p->time = reached;
        p->outcome[p->at] = VI_RUN_IMPACT_LIMIT;
        return RUN_ENDS;
    }
    p->time = early ? reached : end;
    return GO_ON;
}

/* Advance to `end`. After a step that ended early, rows are taken and the time is checked. */
static int advance(const vi_runs_fmu *f, const vi_runs_plan *plan, vi_runs_points *p, double end, double call)
{
    while (p->time < end) {
        if (p->give_up) {
            p->outcome[p->at] = VI_RUN_TIMEOUT;
            return RUN_ENDS;
        }
        if (p->rows_room - p->rows_used < plan->row_capacity) {
            return VI_RUNS_FULL;
        }
        int result = step(f, p, end);
        if (result == GO_ON && p->time < end) {
            result = take_rows(f, plan, p);
            if (result == GO_ON && vi_seconds_since(call) >= p->most_seconds) {
                result = VI_RUNS_LISTEN;
            }
        }
        if (result != GO_ON) {
            return result;
        }
    }
    return GO_ON;
}

static int finish(const vi_runs_fmu *f, const vi_runs_plan *plan, vi_runs_points *p)
{
    const int result = take_rows(f, plan, p);
    if (result != GO_ON) {
        return result;
    }
    double *finals = p->finals + (size_t)p->at * plan->finals_size;
    bool *flags = p->flags + (size_t)p->at * plan->flags.count;
    if (!vi_status_is_good(f->get_float64(f->instance, plan->finals.references, plan->finals.count, finals,
                                          plan->finals_size))
        || (plan->flags.count > 0
            && !vi_status_is_good(f->get_boolean(f->instance, plan->flags.references, plan->flags.count, flags,
                                         plan->flags.count)))
        || !isfinite(finals[0])) {
        return VI_RUNS_REFUSED;
    }
    p->reached[p->at] = p->time;
    if (p->outcome[p->at] == VI_RUN_ENDED && isfinite(finals[1])) {
        p->carried[0] = finals[0];
        p->carried[1] = finals[1];
        p->has_carried = 1;
    }
    return GO_ON;
}

/* Run the present point to its end. */
static int go_on(const vi_runs_fmu *f, const vi_runs_plan *plan, vi_runs_points *p, double call)
{
    int result = GO_ON;
    if (p->stage == NOT_BEGUN) {
        p->outcome[p->at] = VI_RUN_ENDED;
        p->give_up = 0;
        result = begin(f, plan, p);
    }
    if (result == GO_ON && p->stage == BEFORE_RECORDING) {
        result = advance(f, plan, p, p->begin[p->at], call);
        if (result == GO_ON) {
            const bool good = vi_status_is_good(f->set_boolean(f->instance, plan->switches.references, plan->switches.count,
                                                       plan->switch_values, plan->switches.count));
            result = good ? GO_ON : VI_RUNS_REFUSED;
            p->stage = RECORDING;
        }
    }
    if (result == GO_ON && p->stage == RECORDING) {
        result = advance(f, plan, p, p->end[p->at], call);
    }
    if (result == GO_ON || result == RUN_ENDS) {
        p->stage = AT_END;
        result = finish(f, plan, p);
    }
    return result;
}

VI_DOOR int vi_door_runs(const vi_runs_fmu *fmu, const vi_runs_plan *plan, vi_runs_points *points)
{
    const double call = vi_seconds_now();
    double since = call;
    while (points->at < points->count) {
        const int result = go_on(fmu, plan, points, call);
        const double now = vi_seconds_now();
        points->spent += now > since ? now - since : 0.0;
        since = now;
        if (result != GO_ON) {
            return result;
        }
        points->seconds[points->at] = points->spent;
        points->at += 1;
        points->stage = NOT_BEGUN;
        if (now - call >= points->most_seconds || now < call) {
            return points->at < points->count ? VI_RUNS_LISTEN : VI_RUNS_DONE;
        }
    }
    return VI_RUNS_DONE;
}
