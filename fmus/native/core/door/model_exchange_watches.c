#include "door/model_exchange_watches.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "door/model_exchange_forces.h"

enum { OK = VI_EXCHANGE_OK, ERROR = VI_EXCHANGE_ERROR };

/* Most halvings of a step of CVODE in search of the first meeting; then its ends are neighbouring numbers. */
enum { MOST_HALVINGS = 100 };

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
        roots[2 * k] = roots[2 * k + 1] = 1.0;
        if (watch->is_armed) {
            roots[2 * k] = distance(e, watch) - watch->level;
            if (watch->is_pressed) {
                roots[2 * k] = vi_exchange_stop_force(e, watch);
            } else if (is_contact(watch)) { /* never 0, at which CVODE finds roots without end */
                const double closing = -watch->factor * e->values[watch->rate];
                roots[2 * k + 1] = closing != 0.0 ? closing : -DBL_MIN;
            }
        }
    }
}

/* The smallest distance of all contact points from their levels, at a point of the FMU. */
static int nearest(vi_exchange *e, double time, const double states[], double *smallest)
{
    int status = vi_exchange_set_point(e, time, states);
    status = status != OK ? status : vi_exchange_read_watched(e);
    *smallest = INFINITY;
    for (int64_t k = 0; status == OK && k < e->watch_count; k++) {
        const vi_exchange_watch *watch = &e->watches[k];
        if (watch->is_armed && is_contact(watch) && !watch->is_pressed) {
            *smallest = fmin(*smallest, distance(e, watch) - watch->level);
        }
    }
    return status;
}

/* Let the contact points that are at their levels be the roots, by the last values that were read. */
static void mark_met(vi_exchange *e)
{
    for (int64_t k = 0; k < e->watch_count; k++) {
        const vi_exchange_watch *watch = &e->watches[k];
        const bool takes_part = watch->is_armed && is_contact(watch) && !watch->is_pressed;
        e->roots[e->indicator_count + 2 * k] = takes_part && distance(e, watch) <= watch->level ? -1 : 0;
    }
}

void vi_exchange_change_contacts(vi_exchange *e)
{
    for (int64_t k = 0; k < e->watch_count; k++) {
        vi_exchange_watch *watch = &e->watches[k];
        if (e->roots[e->indicator_count + 2 * k] != 0 && is_contact(watch) && vi_contact_law_yields(watch->law.law)) {
            watch->is_pressed = !watch->is_pressed;
        }
    }
}

/* A motion that has turned at the present point was nearer there than before: end the step at the meeting, if any. */
static int search_meeting(vi_exchange *e, double before, bool *event)
{
    double near = before, far = e->time, smallest;
    int status = nearest(e, e->time, e->states, &smallest);
    if (status != OK || smallest > 0.0) {
        return status;
    }
    for (int halving = 0; halving < MOST_HALVINGS; halving++) {
        const double middle = near + 0.5 * (far - near);
        if (!(near < middle && middle < far)) {
            break;
        }
        status = vi_exchange_move_point(e, middle);
        status = status != OK ? status : nearest(e, middle, e->point, &smallest);
        if (status != OK) {
            return status;
        }
        *(smallest > 0.0 ? &near : &far) = middle;
    }
    status = vi_exchange_move_point(e, far);
    status = status != OK ? status : nearest(e, far, e->point, &smallest);
    if (status == OK) {
        memcpy(e->states, e->point, sizeof(double) * (size_t)e->state_count);
        e->time = far;
        *event = false;
        e->meets = 1;
        mark_met(e);
    }
    return status;
}

int vi_exchange_judge_roots(vi_exchange *e, double before, bool *event)
{
    const int flag = e->cvode->roots_found(e->solver, e->roots);
    bool turns = false;
    if (flag != 0) {
        e->solver_flag = flag;
        e->reason = VI_EXCHANGE_SOLVER;
        return ERROR;
    }
    for (int64_t i = 0; i < e->indicator_count; i++) {
        *event = *event || e->roots[i] != 0;
    }
    for (int64_t k = 0; k < e->watch_count; k++) {
        const int *found = &e->roots[e->indicator_count + 2 * k];
        if (is_contact(&e->watches[k])) {
            e->meets = e->meets || found[0] != 0;
            turns = turns || found[1] != 0;
        } else {
            *event = *event || found[0] != 0;
        }
    }
    const int status = turns && !e->meets ? search_meeting(e, before, event) : OK;
    e->begins_anew = e->begins_anew || e->meets;
    return status;
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
