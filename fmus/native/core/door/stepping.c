#include "door/stepping.h"

enum { STATUS_WARNING = 1, STATUS_DISCARD = 2 };

static bool went_well(int status)
{
    return status >= 0 && status <= STATUS_WARNING;
}

/* Advance to `end`; a body that has worked for long ends its step before, and is asked again. */
static int advance(const vi_runs_fmu *f, vi_hold_block *b, double end)
{
    while (b->time < end) {
        bool needs_event = false, ends = false, early = false;
        double reached = b->time;
        const int status = f->step(f->instance, b->time, end - b->time, false, &needs_event, &ends, &early, &reached);
        if (status == STATUS_DISCARD) {
            b->time = reached;
            return VI_HOLD_LIMIT;
        }
        if (!went_well(status) || needs_event || ends) {
            return VI_HOLD_REFUSED;
        }
        b->time = early ? reached : end;
    }
    return VI_HOLD_DONE;
}

VI_DOOR int vi_door_hold(const vi_runs_fmu *fmu, const vi_hold_plan *plan, vi_hold_block *block)
{
    const uint32_t inputs[] = {plan->force, plan->force_rate};
    for (; block->at < block->count; ++block->at) {
        const double values[] = {block->forces[block->at], 0.0};
        if (!went_well(fmu->set_float64(fmu->instance, inputs, 2, values, 2))) {
            return VI_HOLD_REFUSED;
        }
        const int came_to = advance(fmu, block, block->ends[block->at]);
        if (came_to != VI_HOLD_DONE) {
            return came_to;
        }
        double *sample = block->samples + (size_t)block->at * plan->outputs.count;
        if (!went_well(fmu->get_float64(fmu->instance, plan->outputs.references, plan->outputs.count, sample,
                                        plan->outputs.count))) {
            return VI_HOLD_REFUSED;
        }
    }
    return VI_HOLD_DONE;
}
