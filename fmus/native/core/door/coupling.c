#include "door/coupling.h"

#include <float.h>
#include <math.h>

#include "door/seconds.h"
#include "door/status.h"

/* Results of a part of a step, besides VI_COUPLING_*. */
enum { GO_ON = VI_COUPLING_GO_ON, OVERTAKEN = -2 };
/* Most repetitions of one step, each up to an earlier event. */
enum { MOST_REPETITIONS = 1000 };

/* ---- calls ---- */

static int update(const vi_coupling_call *c)
{
    bool *decisions = c->values;
    bool ignored[3];
    double next;
    return c->function.update(c->instance, &decisions[0], &decisions[1], &ignored[0], &ignored[1], &ignored[2], &next);
}

static int scale(const vi_coupling_call *c)
{
    double *values = c->values;
    for (size_t i = 0; i < c->value_count; ++i) {
        values[i] = c->from[i] * c->gains[i];
        if (c->offsets != NULL) {
            values[i] += c->offsets[i];
        }
    }
    return 0;
}

static int made(const vi_coupling_plan *plan, const vi_coupling_call *c)
{
    *plan->noted_call = c->note;
    switch (c->kind) {
    case VI_CALL_MOVE3: return c->function.move3(c->instance, c->references, c->count, c->values, c->value_count);
    case VI_CALL_MOVE2: return c->function.move2(c->instance, c->references, c->count, c->values);
    case VI_CALL_UPDATE: return update(c);
    case VI_CALL_SAVE: return c->function.save(c->instance, c->values);
    case VI_CALL_RESTORE: return c->function.restore(c->instance, *(void **)c->values);
    default: return c->function.plain(c->instance);
    }
}

int vi_coupling_make(const vi_coupling_plan *plan, vi_coupling_run *r, const vi_coupling_calls *calls)
{
    for (size_t i = 0; i < calls->count; ++i) {
        const vi_coupling_call *c = &calls->calls[i];
        const int status = c->kind == VI_CALL_SCALE ? scale(c) : made(plan, c);
        if (!vi_status_is_good(status)) {
            r->at = c->place;
            r->status = status;
            return VI_COUPLING_FAILED;
        }
    }
    return GO_ON;
}

int vi_coupling_save(const vi_coupling_plan *plan, vi_coupling_run *r)
{
    int result = GO_ON;
    for (int32_t i = 0; i < plan->count && result == GO_ON; ++i) {
        result = vi_coupling_make(plan, r, &plan->components[i].save);
    }
    return result;
}

int vi_coupling_restore(const vi_coupling_plan *plan, vi_coupling_run *r)
{
    int result = GO_ON;
    for (int32_t i = 0; i < plan->count && result == GO_ON; ++i) {
        result = vi_coupling_make(plan, r, &plan->components[i].restore);
    }
    return result;
}

/* ---- the step of one component ---- */

/* Does the process round to nearest, with subnormal numbers? An FMU may have changed either. */
static bool rounding_is_usual(void)
{
    static const volatile double one = 1.0, tiny = 1e-17, smallest = DBL_MIN, half = 0.5;
    return one + tiny == one - tiny && smallest * half != 0.0;
}

static int call_step(const vi_coupling_plan *plan, const vi_coupling_component *c)
{
    *plan->noted_call = c->step.note;
    *plan->noted_time = *c->step_time;
    if (c->step.kind == VI_CALL_STEP2) {
        return c->step.function.step2(c->step.instance, *c->step_time, *c->step_size, plan->no_state_prior);
    }
    bool *flags = (bool *)c->flags;
    return c->step.function.step3(c->step.instance, *c->step_time, *c->step_size, plan->no_state_prior != 0, &flags[0],
                                  &flags[1], &flags[2], c->last_time);
}

/* Take the end of a step from an FMI 3.0 component; false where the importer must judge it. */
static bool take_end(const vi_coupling_plan *plan, vi_coupling_component *c)
{
    const double size = *c->step_size, end = *c->step_time + size, reached = *c->last_time;
    if (reached == end) {
        c->time = reached;
        return true;
    }
    const double rounding = plan->time_rounding * (1.0 + fabs(end)) + plan->step_rounding * size;
    const double room = c->internal_step * (1.0 + plan->step_rounding) + rounding;
    const bool early = c->flags[2] != 0, is_inside = *c->step_time - room <= reached && reached <= end + room;
    if (!is_inside || (reached < end - room && !(early && c->may_return_early))) {
        return false;
    }
    c->time = reached > end || !early ? end : reached;
    return true;
}

/* Take the events that an FMI 2.0 component reports for the step just made; NaN: none. */
static double reported(const vi_coupling_plan *plan, vi_coupling_component *c, const vi_coupling_run *r, bool *is_there)
{
    const double *times = c->event_times.calls->values, goal = r->goal;
    double first = INFINITY;
    for (size_t i = 0; i < c->event_times.calls->value_count; ++i) {
        first = times[i] < first ? times[i] : first;
    }
    const double room = plan->same_instant * (1.0 + fabs(goal));
    if (first > goal + room) {
        return goal;
    }
    if (first >= goal - room || first <= r->start) {
        c->time = first;
    }
    *is_there = first >= goal - room;
    return *is_there ? goal : first;
}

/* Size of a component's step to the goal; 0 where the component takes only steps of another size. */
static double size_of_step(const vi_coupling_plan *plan, const vi_coupling_component *c, const vi_coupling_run *r)
{
    const double size = r->goal - r->start;
    if (c->only_step == 0.0) {
        return size;
    }
    return fabs(size - c->only_step) <= plan->step_rounding * c->only_step ? c->only_step : 0.0;
}

/* Step component `i` towards the goal; `reached` is the time of its first event, or the goal. */
static int step_one(const vi_coupling_plan *plan, vi_coupling_run *r, int32_t i, double *reached, bool *has_event)
{
    vi_coupling_component *c = &plan->components[i];
    *reached = r->goal;
    *has_event = false;
    *c->step_time = r->start;
    *c->step_size = size_of_step(plan, c, r);
    r->at = i;
    if (*c->step_size == 0.0) {
        return VI_COUPLING_CUT;
    }
    r->status = call_step(plan, c);
    if (!vi_status_is_good(r->status) || !rounding_is_usual()) {
        return VI_COUPLING_STEPPED;
    }
    if (c->step.kind == VI_CALL_STEP2) {
        c->time = *c->step_time + *c->step_size;
        const int result = vi_coupling_make(plan, r, &c->event_times);
        if (result == GO_ON && c->event_times.count > 0) {
            *reached = reported(plan, c, r, has_event);
        }
        return result;
    }
    if (c->flags[1] != 0 || !take_end(plan, c)) {
        return VI_COUPLING_STEPPED;
    }
    if (c->event_mode) {
        *has_event = c->flags[0] != 0;
        *reached = c->flags[2] != 0 ? c->time : r->goal;
    }
    return GO_ON;
}

/* ---- the step of all ---- */

/* Step all components towards the goal. The first component may end the step early, and the others follow. OVERTAKEN: a
 * later component has met an earlier event, at `reached`. */
static int step_all(const vi_coupling_plan *plan, vi_coupling_run *r, bool may_repeat)
{
    r->arrived = 0;
    for (int32_t i = 0; i < plan->count; ++i) {
        double reached;
        bool has_event;
        int result = vi_coupling_make(plan, r, &plan->components[i].inputs);
        if (result == GO_ON) {
            result = step_one(plan, r, i, &reached, &has_event);
        }
        if (result != GO_ON) {
            return result;
        }
        if (reached < r->goal) {
            const bool ends_it = i == 0 && reached > r->start && plan->components[i].event_mode;
            if (!ends_it && !(may_repeat && reached > r->start)) {
                return VI_COUPLING_STEPPED;
            }
            if (!ends_it) {
                r->reached = reached;
                return OVERTAKEN;
            }
            r->goal = reached;
        }
        if (has_event) {
            r->at_event[r->arrived++] = i;
        }
    }
    r->reached = r->arrived > 0 ? plan->components[r->at_event[0]].time : r->goal;
    return GO_ON;
}

/* Step all components to the first event of any. */
int vi_coupling_step(const vi_coupling_plan *plan, vi_coupling_progress *p, vi_coupling_run *r)
{
    r->goal = r->target;
    for (int k = 0; k < MOST_REPETITIONS; ++k) {
        int result = step_all(plan, r, plan->saves && k + 1 < MOST_REPETITIONS);
        if (result != OVERTAKEN) {
            return result;
        }
        p->repeated_steps += 1;
        r->goal = r->reached;
        result = vi_coupling_restore(plan, r);
        if (result != GO_ON) {
            return result;
        }
    }
    return VI_COUPLING_STEPPED;
}

/* ---- events ---- */

static bool any_decision(const vi_coupling_plan *plan, int which)
{
    for (int32_t i = 0; i < plan->deciding; ++i) {
        if (plan->decisions[i][which] != 0) {
            return true;
        }
    }
    return false;
}

/* Carry values and update discrete states until all components are settled. */
static int resolve(const vi_coupling_plan *plan, vi_coupling_run *r)
{
    int result = vi_coupling_make(plan, r, &plan->begin);
    for (int32_t k = 1; result == GO_ON && any_decision(plan, 0); ++k) {
        result = vi_coupling_make(plan, r, &plan->again);
        if (result == GO_ON && k == plan->most_iterations) {
            return VI_COUPLING_ENDLESS;
        }
    }
    if (result == GO_ON && any_decision(plan, 1)) {
        r->wants_to_end = 1;
    }
    return result == GO_ON ? vi_coupling_make(plan, r, &plan->leave) : result;
}

static void note(const vi_coupling_plan *plan, vi_coupling_progress *p, vi_coupling_run *r)
{
    for (int32_t k = 0; k < r->arrived; ++k) {
        p->event_index = p->time == p->event_time ? p->event_index + 1 : 0;
        p->event_time = p->time;
        if (r->events != NULL) {
            double *row = r->events + 3 * r->events_used;
            row[0] = p->time;
            row[1] = (double)p->event_index;
            row[2] = (double)plan->components[r->at_event[k]].number;
            r->events_used += 1;
        }
    }
}

/* ---- the run ---- */

static int finish(const vi_coupling_plan *plan, vi_coupling_progress *p, vi_coupling_run *r)
{
    const bool has_room = r->events == NULL || r->events_used + r->arrived <= r->events_room;
    const bool pauses = r->arrived == 0 && r->reached < r->target && r->hears_pauses;
    if (!(r->reached > r->start) || !has_room || pauses) {
        return VI_COUPLING_REACHED;
    }
    p->time = r->reached;
    p->standstill = 0;
    p->steps += 1;
    if (r->arrived == 0) {
        return GO_ON;
    }
    note(plan, p, r);
    return resolve(plan, r);
}

static int step(const vi_coupling_plan *plan, vi_coupling_progress *p, vi_coupling_run *r)
{
    r->start = p->time;
    r->target = p->next_point < r->end ? p->next_point : r->end;
    int result = vi_coupling_make(plan, r, &plan->start);
    if (result == GO_ON && plan->saves) {
        result = vi_coupling_save(plan, r);
    }
    if (result == GO_ON) {
        result = vi_coupling_step(plan, p, r);
    }
    return result == GO_ON ? finish(plan, p, r) : result;
}

/* Find the next communication point: the next multiple of the macro step. */
static bool pass_point(const vi_coupling_run *r, vi_coupling_progress *p, double room)
{
    if (r->macro_step <= room) {
        return false;
    }
    while (p->next_point - p->time <= room) {
        p->grid_index += 1;
        p->next_point = p->grid_start + (double)(p->grid_index + 1) * r->macro_step;
    }
    return true;
}

VI_DOOR int vi_door_coupling(const vi_coupling_plan *plan, vi_coupling_progress *progress, vi_coupling_run *run)
{
    const double call = vi_seconds_now();
    while (!run->wants_to_end) {
        const double time = progress->time, room = plan->same_instant * (1.0 + fabs(time));
        if (run->end - time <= room) {
            progress->time = run->end > time ? run->end : time;
            return VI_COUPLING_DONE;
        }
        if (progress->next_point - time <= room && !pass_point(run, progress, room)) {
            return VI_COUPLING_LISTEN;
        }
        const int result = step(plan, progress, run);
        if (result != GO_ON) {
            return result;
        }
        if (vi_seconds_since(call) >= run->most_seconds) {
            return VI_COUPLING_LISTEN;
        }
    }
    return VI_COUPLING_DONE;
}
