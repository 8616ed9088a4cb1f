#include "door/stepping.h"

#include "body/record.h"
#include "door/seconds.h"
#include "door/status.h"

/* Longest wall time of one call, s; signals and deadlines are handled between calls. */
static const double MOST_SECONDS = 0.05;

/* Take the rows recorded by the body. */
static int take_rows(const vi_runs_fmu *f, const vi_hold_plan *plan, vi_hold_block *b)
{
    if (plan->row_capacity == 0) {
        return VI_HOLD_DONE;
    }
    if (b->rows_room - b->rows_used < plan->row_capacity) {
        return VI_HOLD_AGAIN;
    }
    int64_t count = 0;
    if (!vi_status_is_good(f->get_int64(f->instance, &plan->record_count, 1, &count, 1))) {
        return VI_HOLD_REFUSED;
    }
    if (count == 0) {
        return VI_HOLD_DONE;
    }
    double *rows = b->rows + b->rows_used * VI_RECORD_WIDTH;
    const size_t size = (size_t)plan->row_capacity * VI_RECORD_WIDTH;
    if (!vi_status_is_good(f->get_float64(f->instance, &plan->record_rows, 1, rows, size))
        || !vi_status_is_good(f->set_int64(f->instance, &plan->record_taken, 1, &count, 1))) {
        return VI_HOLD_REFUSED;
    }
    b->rows_used += count;
    return VI_HOLD_DONE;
}

/* Set the input of the step to sample `at`, which begins now. */
static int set_input(const vi_runs_fmu *f, const vi_hold_plan *plan, const vi_hold_block *b)
{
    if (b->renewed != NULL && !b->renewed[b->at]) {
        return VI_HOLD_DONE;
    }
    const uint32_t inputs[] = {plan->input, plan->input_rate};
    double values[] = {b->inputs[b->at], b->rates == NULL ? 0.0 : b->rates[b->at]};
    if (plan->magnet != NULL) {
        double displacement = 0.0;
        if (!vi_status_is_good(f->get_float64(f->instance, &plan->displacement, 1, &displacement, 1))) {
            return VI_HOLD_REFUSED;
        }
        if (!(vi_magnet_gap(plan->magnet, displacement) > 0.0)) {
            return VI_HOLD_TOUCHES;
        }
        values[0] = vi_magnet_force(plan->magnet, values[0], displacement);
    }
    return vi_status_is_good(f->set_float64(f->instance, inputs, 2, values, 2)) ? VI_HOLD_DONE : VI_HOLD_REFUSED;
}

/* Advance to sample `at`; a long computation or a full record ends the step earlier. */
static int advance(const vi_runs_fmu *f, const vi_hold_plan *plan, vi_hold_block *b)
{
    const double end = b->ends[b->at];
    while (b->time < end) {
        bool needs_event = false, ends = false, early = false;
        double reached = b->time;
        const int status = f->step(f->instance, b->time, end - b->time, false, &needs_event, &ends, &early, &reached);
        if (status == VI_STATUS_DISCARD || (ends && vi_status_is_good(status))) {
            b->time = reached;
            return ends ? VI_HOLD_ENDS : VI_HOLD_LIMIT;
        }
        if (!vi_status_is_good(status) || needs_event || ends) {
            return VI_HOLD_REFUSED;
        }
        b->time = early ? reached : end;
        if (early) {
            const int took = take_rows(f, plan, b);
            return took == VI_HOLD_DONE ? VI_HOLD_AGAIN : took;
        }
    }
    return VI_HOLD_DONE;
}

static int read_sample(const vi_runs_fmu *f, const vi_hold_plan *plan, const vi_hold_block *b)
{
    const size_t count = plan->outputs.count;
    double *sample = b->samples + (size_t)b->at * count;
    const bool good = count == 0 || vi_status_is_good(f->get_float64(f->instance, plan->outputs.references, count, sample, count));
    return good ? VI_HOLD_DONE : VI_HOLD_REFUSED;
}

static int begin_step(const vi_runs_fmu *f, const vi_hold_plan *plan, const vi_hold_block *b)
{
    const int result = set_input(f, plan, b);
    return result == VI_HOLD_DONE && plan->reads_begin ? read_sample(f, plan, b) : result;
}

VI_DOOR int vi_door_hold(const vi_runs_fmu *fmu, const vi_hold_plan *plan, vi_hold_block *block)
{
    const double call = vi_seconds_now();
    while (block->at < block->count) {
        int result = block->begun ? VI_HOLD_DONE : begin_step(fmu, plan, block);
        if (result == VI_HOLD_DONE) {
            block->begun = 1;
            result = advance(fmu, plan, block);
        }
        if (result == VI_HOLD_DONE && !plan->reads_begin) {
            result = read_sample(fmu, plan, block);
        }
        if (result != VI_HOLD_DONE) {
            return result;
        }
        block->begun = 0;
        block->at += 1;
        if (block->at < block->count && vi_seconds_since(call) >= MOST_SECONDS) {
            return VI_HOLD_AGAIN;
        }
    }
    return take_rows(fmu, plan, block);
}
