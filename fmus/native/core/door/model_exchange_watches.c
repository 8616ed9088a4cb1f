#include "door/model_exchange_watches.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "door/model_exchange_forces.h"

enum { OK = VI_EXCHANGE_OK, ERROR = VI_EXCHANGE_ERROR };

static bool is_contact(const vi_exchange_watch *watch)
{
    return watch->rate >= 0;
}

static double distance(const vi_exchange *e, const vi_exchange_watch *watch)
{
    return watch->factor * e->values[watch->value] + watch->offset;
}

int vi_exchange_mark_watches(vi_exchange *e)
{
    if (e->watch_count == 0) {
        return OK;
    }
    const int status = vi_exchange_read_watched(e);
    for (int64_t k = 0; status == OK && k < e->watch_count; k++) {
        vi_exchange_watch *watch = &e->watches[k];
        watch->largest = 0.0;
        watch->was_pressed = watch->is_pressed;
        if (is_contact(watch)) {
            const double now = distance(e, watch);
            watch->level = now > watch->room ? 0.0 : fmin(now, 0.0) - fmax(watch->room, DBL_MIN);
            watch->end = now;
            watch->end_rate = watch->factor * e->values[watch->rate];
        }
    }
    return status;
}

int vi_exchange_follow_watches(vi_exchange *e)
{
    bool touches = false;
    for (int64_t k = 0; k < e->watch_count; k++) {
        touches = touches || (is_contact(&e->watches[k]) && e->watches[k].level != 0.0);
    }
    const int status = touches ? vi_exchange_read_watched(e) : OK;
    for (int64_t k = 0; touches && status == OK && k < e->watch_count; k++) {
        vi_exchange_watch *watch = &e->watches[k];
        if (is_contact(watch) && distance(e, watch) > watch->room) {
            watch->level = 0.0;
        }
    }
    return status;
}

void vi_exchange_watch_roots(const vi_exchange *e, double roots[])
{
    for (int64_t k = 0; k < e->watch_count; k++) {
        const vi_exchange_watch *watch = &e->watches[k];
        roots[k] = 1.0;
        if (watch->is_armed) {
            roots[k] = watch->is_pressed ? vi_exchange_stop_force(e, watch) : distance(e, watch) - watch->level;
        }
    }
}

void vi_exchange_change_contacts(vi_exchange *e)
{
    for (int64_t k = 0; k < e->watch_count; k++) {
        vi_exchange_watch *watch = &e->watches[k];
        if (e->roots[e->indicator_count + k] != 0 && is_contact(watch) && vi_contact_law_yields(watch->law.law)) {
            watch->is_pressed = !watch->is_pressed;
        }
    }
}

int vi_exchange_judge_roots(vi_exchange *e, bool has_roots, bool *event)
{
    if (!has_roots) {
        memset(e->roots, 0, sizeof(int) * (size_t)(e->indicator_count + e->watch_count));
        return OK;
    }
    const int flag = e->cvode->roots_found(e->solver, e->roots);
    if (flag != 0) {
        e->solver_flag = flag;
        e->reason = VI_EXCHANGE_SOLVER;
        return ERROR;
    }
    for (int64_t i = 0; i < e->indicator_count; i++) {
        *event = *event || e->roots[i] != 0;
    }
    for (int64_t k = 0; k < e->watch_count; k++) {
        const bool is_found = e->roots[e->indicator_count + k] != 0;
        e->meets = e->meets || (is_found && is_contact(&e->watches[k]));
        *event = *event || (is_found && !is_contact(&e->watches[k]));
    }
    return OK;
}

int vi_exchange_keep_samples(vi_exchange *e, bool by_solver)
{
    const size_t count = (size_t)e->state_count;
    for (; e->sample_count < e->instant_count && e->instants[e->sample_count] <= e->time; e->sample_count++) {
        if (count == 0) {
            continue;
        }
        const int status = by_solver ? vi_exchange_move_point(e, e->instants[e->sample_count]) : OK;
        if (status != OK) {
            return status;
        }
        memcpy(e->samples + (size_t)e->sample_count * count, by_solver ? e->point : e->states, sizeof(double) * count);
    }
    return OK;
}
