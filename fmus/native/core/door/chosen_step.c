#include "door/chosen_step.h"

#include <math.h>
#include <string.h>

#include "door/status.h"

enum { GO_ON = VI_COUPLING_GO_ON };

/* ---- the scales of the variables ---- */

/* Rest of the first seconds of a variable's motion, in which it has no scale, s. */
static double left(const vi_chosen_step *s, int64_t i, double time)
{
    return fmax(s->window - fmax(time - s->since[i], 0.0), 0.0);
}

static bool rises(const vi_chosen_step *s, int64_t i, double value, double time)
{
    return left(s, i, time) > 0.0 && fabs(value) > s->known[i];
}

/* Take values of an accepted instant into the scales. */
static void learn(vi_chosen_step *s, double time, const double values[])
{
    bool is_larger = false;
    double latest = -INFINITY;
    for (int64_t u = 0; u < s->units; ++u) {
        s->largest[u] = 0.0;
    }
    for (int64_t i = 0; i < s->count; ++i) {
        const double size = fabs(values[i]);
        if (size > s->known[i]) {
            s->since[i] = s->known[i] == 0.0 ? time : s->since[i];
            s->known[i] = size;
            is_larger = true;
        }
        latest = fmax(latest, s->since[i]);
        s->largest[s->unit[i]] = fmax(s->largest[s->unit[i]], s->known[i]);
    }
    if (!is_larger) {
        return;
    }
    *s->all_known = latest + s->window;
    for (int64_t i = 0; i < s->count; ++i) {
        s->rounding[i] = s->rounding_part * s->largest[s->unit[i]];
    }
}

static double scale_of(const vi_chosen_step *s, int64_t i, double after, double end, double size)
{
    const double known = fmax(fmax(s->known[i], fabs(after)), s->rounding[i] / s->tolerance);
    if (!(end < *s->all_known) || !rises(s, i, after, end)) {
        return known;
    }
    return fmax(known, fabs(after - s->before[i]) / size * left(s, i, end));
}

/* Find the largest error of a step; false where a value is no finite number. */
static bool judge(vi_chosen_step *s, double end, double size)
{
    s->error = -INFINITY;
    for (int64_t i = 0; i < s->count; ++i) {
        const double whole = s->whole[i], halves = s->halves[i];
        /* in one step a body at rest may not have felt a force yet */
        const double after = fabs(halves) > fabs(whole) ? halves : whole;
        const double beyond = fmax(fabs(whole - halves) - s->rounding[i], 0.0);
        const double scale = scale_of(s, i, after, end, size);
        if (!isfinite(whole - halves) || !isfinite(s->before[i]) || !isfinite(scale)) {
            return false;
        }
        double error = beyond / s->share / fmax(scale, s->smallest) / s->tolerance;
        if (size <= s->first_size && rises(s, i, after, end)) {
            error = fmin(error, s->steady);
        }
        if (error > s->error) {
            s->error = error;
            s->worst = i;
        }
    }
    if (s->error <= 1.0) {
        learn(s, end, s->whole);
    }
    return true;
}

/* ---- the steps ---- */

static int read_values(const vi_coupling_plan *plan, vi_chosen_step *s, vi_coupling_run *r, double values[])
{
    const int result = vi_coupling_make(plan, r, &s->read);
    for (size_t k = 0; k < s->read.count; ++k) {
        const vi_coupling_call *c = &s->read.calls[k];
        memcpy(values, c->values, c->value_count * sizeof *values);
        values += c->value_count;
    }
    return result;
}

/* Read the compared variables after all outputs are carried to inputs. */
static int consistent_values(const vi_coupling_plan *plan, vi_chosen_step *s, vi_coupling_run *r, double values[])
{
    const int result = vi_coupling_make(plan, r, &s->moves);
    return result == GO_ON ? read_values(plan, s, r, values) : result;
}

/* Make a half step. */
static int half_step(const vi_coupling_plan *trial, vi_chosen_step *s, vi_coupling_run *r, double start, double target)
{
    vi_coupling_progress ignored = {0};
    r->start = start;
    r->target = target;
    int result = vi_coupling_make(trial, r, &s->moves);
    if (result == GO_ON) {
        result = vi_coupling_save(trial, r);
    }
    return result == GO_ON ? vi_coupling_step(trial, &ignored, r) : result;
}

/* Make both half steps from the start. The error is infinite if the first one ends at an event: no step that ends there
 * may be longer, but the shortest. */
static int both_halves(const vi_coupling_plan *plan, vi_chosen_step *s, vi_coupling_run *r, double end, double size,
                       bool *is_cut)
{
    vi_coupling_plan trial = *plan;
    trial.components = s->trial;
    const double start = r->start, middle = start + 0.5 * size;
    int result = half_step(&trial, s, r, start, middle);
    if (result == GO_ON && (r->reached < middle || r->arrived > 0)) {
        s->error = size <= s->shortest ? 0.0 : INFINITY;
        s->worst = 0;
        *is_cut = true;
        return GO_ON;
    }
    /* an FMU that repeats a last step that is not accepted has none after a restored state */
    if (result == GO_ON) {
        result = vi_coupling_save(&trial, r);
    }
    if (result == GO_ON) {
        result = vi_coupling_restore(&trial, r);
    }
    trial.no_state_prior = 0;
    if (result == GO_ON) {
        result = half_step(&trial, s, r, middle, end);
    }
    return result == GO_ON ? consistent_values(plan, s, r, s->halves) : result;
}

/* Keep the answers of the components' last steps. */
static void keep_answers(const vi_coupling_plan *plan, vi_chosen_step *s)
{
    for (int32_t i = 0; i < plan->count; ++i) {
        const vi_coupling_component *c = &plan->components[i];
        s->kept_times[2 * i] = s->trial[i].time = c->time;
        if (c->flags != NULL) {
            memcpy(&s->kept_flags[i], c->flags, sizeof *s->kept_flags);
            s->kept_times[2 * i + 1] = *c->last_time;
        }
    }
}

static void give_answers_back(const vi_coupling_plan *plan, const vi_chosen_step *s)
{
    for (int32_t i = 0; i < plan->count; ++i) {
        vi_coupling_component *c = &plan->components[i];
        c->time = s->kept_times[2 * i];
        if (c->flags != NULL) {
            memcpy(c->flags, &s->kept_flags[i], sizeof *s->kept_flags);
            *c->last_time = s->kept_times[2 * i + 1];
        }
    }
}

/* Estimate the error of the step just made; all end as they were. */
static int estimate(const vi_coupling_plan *plan, vi_chosen_step *s, vi_coupling_run *run)
{
    const double end = run->reached, size = end - run->start;
    vi_coupling_run r = *run;
    r.at_event = s->at_event;
    bool is_cut = false;
    keep_answers(plan, s);
    int result = vi_coupling_make(plan, &r, &s->save_end);
    if (result == GO_ON) {
        result = consistent_values(plan, s, &r, s->whole);
    }
    if (result == GO_ON) {
        result = vi_coupling_restore(plan, &r);
    }
    if (result == GO_ON) {
        result = consistent_values(plan, s, &r, s->before);
    }
    if (result == GO_ON) {
        result = both_halves(plan, s, &r, end, size, &is_cut);
    }
    if (result == GO_ON) {
        result = vi_coupling_make(plan, &r, &s->restore_end);
    }
    if (result != GO_ON) {
        for (int32_t i = 0; i < plan->count; ++i) {
            plan->components[i].time = s->trial[i].time; /* for the message */
        }
        run->at = r.at;
        run->status = r.status;
        return result;
    }
    give_answers_back(plan, s);
    return is_cut || judge(s, end, size) ? GO_ON : VI_COUPLING_LISTEN;
}

VI_DOOR int vi_door_chosen_step(const vi_coupling_plan *plan, vi_chosen_step *chosen, vi_coupling_progress *progress,
                                vi_coupling_run *run)
{
    const int64_t repeated = progress->repeated_steps;
    int result = vi_coupling_save(plan, run);
    if (result != GO_ON) {
        return result;
    }
    result = vi_coupling_step(plan, progress, run);
    if (result == GO_ON) {
        result = run->reached > run->start ? estimate(plan, chosen, run) : VI_COUPLING_LISTEN;
    }
    if (result == GO_ON) {
        return VI_COUPLING_REACHED;
    }
    const bool is_bad = !vi_status_is_good(run->status) && run->status != VI_STATUS_DISCARD;
    if (result == VI_COUPLING_FAILED || (result == VI_COUPLING_STEPPED && is_bad)) {
        return result;
    }
    progress->repeated_steps = repeated;
    result = vi_coupling_restore(plan, run);
    return result == GO_ON ? VI_COUPLING_LISTEN : result;
}
