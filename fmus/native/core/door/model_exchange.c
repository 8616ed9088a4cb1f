#include "door/model_exchange.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "door/model_exchange_forces.h"
#include "door/model_exchange_search.h"
#include "door/model_exchange_watches.h"

enum { OK = VI_EXCHANGE_OK, DISCARD = VI_EXCHANGE_DISCARD, ERROR = VI_EXCHANGE_ERROR };
/* Constants of CVODE. */
enum { BDF = 2, ONE_STEP = 2, ROOT_RETURN = 2, ROOTS_FAIL = -12 };
/* Answers of a function to CVODE. */
enum { GOOD = 0, SHORTER_STEP = 1, GIVE_UP = -1 };

/* Largest distance of the start of a step from the time of the FMU, over 1 + |time|, s. */
static const double SAME_TIME = 1e-9;
/* Instants closer than this times 1 + |time|, s, are one: as the importer's. */
static const double SAME_INSTANT = 1e-13;
/* Steps shorter than this times the time, s, are made by the derivative alone: CVODE takes none so short. */
static const double SHORTEST_STEP = 1e-15;
/* Steps below this times the time, s, make no progress; so many in succession end the run. */
static const double ROUNDING = 1e-14;
enum { MOST_SHORT_STEPS = 100 };
/* A step at whose points the event indicators are unknown is divided by this number, at most so often. */
static const double DIVIDE = 4.0;
enum { MOST_DIVISIONS = 40 };
/* The first steps of CVODE after a start have low orders, and errors of one sign. They get this share of the
 * tolerance, down to the finest relative tolerance of a step. */
static const double FIRST_SHARE = 0.1, FINEST = 1e-14;
enum { FIRST_STEPS = 20 };

/* FMI 2.0's answer of an event iteration. */
typedef struct {
    int again, ends, nominals, values, has_next;
    double next;
} event_info;

typedef struct {
    void *fmu_state;
    double time, next_event;
    int32_t in_event_mode, ends;
    double numbers[]; /* states, event indicators, and for each watch: whether it is pressed, its impulse */
} saved_state;

static bool are_finite(const double numbers[], int64_t count)
{
    for (int64_t i = 0; i < count; i++) {
        if (!isfinite(numbers[i])) {
            return false;
        }
    }
    return true;
}

/* ---- what CVODE calls ---- */

/* The answer to CVODE after calls that ended with `status` and gave these numbers. */
static int answer(vi_exchange *e, int status, int function, const double numbers[], int64_t count)
{
    if (status == OK && are_finite(numbers, count)) {
        return GOOD;
    }
    if (status == OK) {
        vi_exchange_refused(e, function, VI_EXCHANGE_NOT_FINITE);
    }
    e->cause = e->function;
    if (status == OK || status == DISCARD) {
        return SHORTER_STEP;
    }
    e->failure = status;
    return GIVE_UP;
}

static int derivatives_at(double time, void *states, void *derivatives, void *user)
{
    vi_exchange *e = user;
    double *rates = e->cvode->vector_data(derivatives);
    int status = vi_door_exchange_show(e, time, e->cvode->vector_data(states));
    if (e->state_count == 0) {
        rates[0] = 0.0;
        return answer(e, status, VI_EXCHANGE_SET_TIME, rates, 1);
    }
    if (status == OK) {
        e->derivative_calls++;
        status = vi_exchange_get_numbers(e, VI_EXCHANGE_DERIVATIVES, rates, e->state_count);
    }
    return answer(e, status, VI_EXCHANGE_DERIVATIVES, rates, e->state_count);
}

/* The functions whose roots end a step: event indicators, then one of each watch. */
static int roots_at(double time, void *states, double *roots, void *user)
{
    vi_exchange *e = user;
    int status = vi_door_exchange_show(e, time, e->cvode->vector_data(states));
    status = status != OK ? status : vi_exchange_get_numbers(e, VI_EXCHANGE_INDICATORS, roots, e->indicator_count);
    const int found = answer(e, status, VI_EXCHANGE_INDICATORS, roots, e->indicator_count);
    if (found != GOOD || e->watch_count == 0) {
        return found;
    }
    status = vi_exchange_read_watched(e);
    vi_exchange_watch_roots(e, roots + e->indicator_count);
    return answer(e, status, VI_EXCHANGE_GET, e->values, e->watched_count);
}

/* The weights of errors: one step of CVODE may have errors whose weighted mean is 1. */
static int weights_at(void *states, void *weights, void *user)
{
    const vi_exchange *e = user;
    const bool is_first = e->solver_steps - e->first_step < FIRST_STEPS;
    const double share = is_first ? fmax(FIRST_SHARE, FINEST / e->tolerance) : 1.0;
    const double *x = e->cvode->vector_data(states);
    double *weight = e->cvode->vector_data(weights);
    for (int64_t i = 0; i < e->state_count || i == 0; i++) {
        weight[i] = 1.0 / (share * (e->tolerance * fabs(x[i]) + e->absolute[i]));
    }
    return GOOD;
}

/* CVODE's own messages are not printed: its flag says all. */
static void ignore_message(int line, const char *function, const char *file, const char *text, int code, void *user,
                           void *context)
{
    (void)line, (void)function, (void)file, (void)text, (void)code, (void)user, (void)context;
}

/* ---- the solver ---- */

static int solver_failed(vi_exchange *e, int flag)
{
    e->solver_flag = flag;
    return vi_exchange_refused(e, e->function, VI_EXCHANGE_SOLVER);
}

static int make_solver(vi_exchange *e)
{
    const vi_cvode *c = e->cvode;
    const int64_t count = e->state_count > 0 ? e->state_count : 1; /* without states: one that stays */
    if (c->create_context(0, &e->context) != 0) {
        return solver_failed(e, 0);
    }
    c->clear_messages(e->context);
    c->push_message(e->context, ignore_message, NULL);
    e->vector = c->make_vector(count, e->states, e->context);
    e->point_vector = c->make_vector(count, e->point, e->context);
    e->matrix = c->make_matrix(count, count, e->context);
    e->linear = c->make_linear(e->vector, e->matrix, e->context);
    e->solver = c->create(BDF, e->context);
    if (e->vector == NULL || e->point_vector == NULL || e->matrix == NULL || e->linear == NULL || e->solver == NULL) {
        return solver_failed(e, 0);
    }
    int flag = c->init(e->solver, derivatives_at, e->time, e->vector);
    flag = flag != 0 ? flag : c->set_weights(e->solver, weights_at);
    flag = flag != 0 ? flag : c->set_roots(e->solver, (int)(e->indicator_count + e->watch_count), roots_at);
    flag = flag != 0 || e->watch_count == 0 ? flag : c->set_directions(e->solver, e->directions);
    flag = flag != 0 ? flag : c->set_linear(e->solver, e->linear, e->matrix);
    flag = flag != 0 ? flag : c->set_user(e->solver, e);
    flag = flag != 0 ? flag : c->no_root_warning(e->solver);
    flag = flag != 0 ? flag : c->set_warnings(e->solver, -1);
    return flag == 0 ? OK : solver_failed(e, flag);
}

void vi_door_exchange_end(vi_exchange *e)
{
    const vi_cvode *c = e->cvode;
    if (e->solver != NULL) {
        c->free(&e->solver);
    }
    if (e->linear != NULL) {
        c->free_linear(e->linear);
    }
    if (e->matrix != NULL) {
        c->free_matrix(e->matrix);
    }
    if (e->point_vector != NULL) {
        c->free_vector(e->point_vector);
    }
    if (e->vector != NULL) {
        c->free_vector(e->vector);
    }
    if (e->context != NULL) {
        c->free_context(&e->context);
    }
    e->solver = e->linear = e->matrix = e->vector = e->point_vector = e->context = NULL;
    e->has_begun = 0;
}

/* Absolute tolerances from the nominal values; a nominal value of 0 counts as 1. */
static int read_nominals(vi_exchange *e)
{
    const int status = vi_exchange_get_numbers(e, VI_EXCHANGE_NOMINALS, e->absolute, e->state_count);
    if (status != OK) {
        return status;
    }
    if (!are_finite(e->absolute, e->state_count)) {
        return vi_exchange_refused(e, VI_EXCHANGE_NOMINALS, VI_EXCHANGE_NOT_FINITE);
    }
    for (int64_t i = 0; i < e->state_count; i++) {
        e->absolute[i] = e->tolerance * (e->absolute[i] != 0.0 ? fabs(e->absolute[i]) : 1.0);
    }
    if (e->state_count == 0) {
        e->absolute[0] = e->tolerance;
    }
    return OK;
}

static int restart_solver(vi_exchange *e)
{
    const vi_cvode *c = e->cvode;
    e->begins_anew = 0;
    e->first_step = e->solver_steps;
    if (e->solver == NULL) {
        return make_solver(e);
    }
    const int flag = c->begin_anew(e->solver, e->time, e->vector);
    return flag == 0 ? OK : solver_failed(e, flag);
}

/* ---- a run ---- */

int vi_door_exchange_begin(vi_exchange *e, double time)
{
    vi_door_exchange_end(e);
    e->time = time;
    e->next_event = INFINITY;
    e->has_begun = e->in_event_mode = e->begins_anew = e->nominals_changed = 1;
    e->ends = e->inputs_changed = 0;
    e->derivative_calls = e->solver_steps = 0;
    e->states[0] = 1.0;
    return OK;
}

int vi_door_exchange_enter(vi_exchange *e)
{
    const int status = vi_exchange_call(e, VI_EXCHANGE_ENTER_EVENT);
    e->in_event_mode = status == OK;
    return status;
}

int vi_door_exchange_update(vi_exchange *e, bool *again, bool *ends, bool *nominals, bool *values, bool *has_next,
                            double *next)
{
    const vi_exchange_function call = vi_exchange_begin_call(e, VI_EXCHANGE_UPDATE);
    int status;
    if (e->version == 3) {
        status = call.update3(e->fmu, again, ends, nominals, values, has_next, next);
    } else {
        event_info info = {0};
        status = call.update2(e->fmu, &info);
        *again = info.again != 0;
        *ends = info.ends != 0;
        *nominals = info.nominals != 0;
        *values = info.values != 0;
        *has_next = info.has_next != 0;
        *next = info.next;
    }
    if (vi_exchange_judged(e, VI_EXCHANGE_UPDATE, status) != OK) {
        return status;
    }
    if (*has_next && isnan(*next)) {
        return vi_exchange_refused(e, VI_EXCHANGE_UPDATE, VI_EXCHANGE_NOT_FINITE);
    }
    e->next_event = *has_next ? *next : (double)INFINITY;
    e->nominals_changed = e->nominals_changed || *nominals;
    return OK;
}

int vi_door_exchange_leave(vi_exchange *e)
{
    int status = vi_exchange_call(e, VI_EXCHANGE_ENTER_CONTINUOUS);
    status = status != OK ? status : vi_exchange_get_numbers(e, VI_EXCHANGE_GET_STATES, e->states, e->state_count);
    if (status == OK && !are_finite(e->states, e->state_count)) {
        return vi_exchange_refused(e, VI_EXCHANGE_GET_STATES, VI_EXCHANGE_NOT_FINITE);
    }
    if (status == OK && e->nominals_changed) {
        status = read_nominals(e);
    }
    status = status != OK ? status
                          : vi_exchange_get_numbers(e, VI_EXCHANGE_INDICATORS, e->indicators, e->indicator_count);
    if (status == OK) {
        e->nominals_changed = e->inputs_changed = e->in_event_mode = 0;
        e->begins_anew = 1;
    }
    return status;
}

/* ---- steps ---- */

/* Tell the FMU that the step to the present point is completed. */
static int complete_step(vi_exchange *e, bool no_state_prior, bool *event, bool *ends)
{
    if (!e->needs_completed) {
        return OK;
    }
    const vi_exchange_function call = vi_exchange_begin_call(e, VI_EXCHANGE_COMPLETED);
    /* the importer may still go back to the start of the step */
    const bool is_final = no_state_prior && !e->restorable;
    if (e->version == 3) {
        return vi_exchange_judged(e, VI_EXCHANGE_COMPLETED, call.completed3(e->fmu, is_final, event, ends));
    }
    int event2 = 0, ends2 = 0;
    const int status = call.completed2(e->fmu, is_final, &event2, &ends2);
    *event = event2 != 0;
    *ends = ends2 != 0;
    return vi_exchange_judged(e, VI_EXCHANGE_COMPLETED, status);
}

/* Finish a step of CVODE from `before`: its roots, the impulses of stops up to there, and samples. */
static int after_solver(vi_exchange *e, double before, bool has_roots, bool *root)
{
    int status = vi_exchange_judge_roots(e, has_roots, root);
    status = status != OK ? status : vi_exchange_search_step(e, before, has_roots, root);
    status = status != OK ? status : vi_exchange_add_impulses(e, before);
    if (status == OK) {
        e->begins_anew = e->begins_anew || e->meets;
        vi_exchange_change_contacts(e);
    }
    return status != OK ? status : vi_exchange_keep_samples(e, true);
}

/* One step of CVODE towards `goal`; `root` becomes whether an indicator has changed its sign at its end. */
static int solver_step(vi_exchange *e, double goal, bool *root)
{
    const vi_cvode *c = e->cvode;
    const size_t bytes = sizeof(double) * (size_t)(e->state_count > 0 ? e->state_count : 1);
    const double before = e->time;
    memcpy(e->kept, e->states, bytes);
    for (int division = 0;; division++) {
        if (e->begins_anew) {
            const int status = restart_solver(e);
            if (status != OK) {
                return status;
            }
        }
        double reached = e->time;
        int flag = c->set_stop(e->solver, goal);
        e->failure = OK;
        flag = flag != 0 ? flag : c->advance(e->solver, goal, e->vector, &reached, ONE_STEP);
        if (flag >= 0) {
            e->time = reached;
            e->solver_steps++;
            if (division > 0) {
                c->set_longest(e->solver, 0.0); /* none */
            }
            return after_solver(e, before, flag == ROOT_RETURN, root);
        }
        if (e->failure != OK) { /* of the FMU: no function is called after it */
            e->reason = VI_EXCHANGE_STATUS;
            return e->failure;
        }
        double tried = e->time;
        c->current_time(e->solver, &tried);
        memcpy(e->states, e->kept, bytes);
        if (flag != ROOTS_FAIL || division == MOST_DIVISIONS || !(tried > e->time)) {
            return solver_failed(e, flag);
        }
        e->begins_anew = 1; /* the indicators are unknown there: a shorter step */
        c->set_longest(e->solver, (tried - e->time) / DIVIDE);
    }
}

/* A step below the rounding of CVODE. */
static int rounding_step(vi_exchange *e, double goal)
{
    int status = vi_exchange_get_numbers(e, VI_EXCHANGE_DERIVATIVES, e->kept, e->state_count);
    for (int64_t i = 0; status == OK && i < e->state_count; i++) {
        e->states[i] += (goal - e->time) * e->kept[i];
    }
    e->time = goal;
    e->begins_anew = 1;
    return status != OK ? status : vi_exchange_keep_samples(e, false);
}

static int step_towards(vi_exchange *e, double goal, bool *root)
{
    *root = false;
    if (e->state_count == 0 && e->indicator_count == 0 && e->watch_count == 0) {
        e->time = goal;
        return vi_exchange_keep_samples(e, false);
    }
    if (goal - e->time <= SHORTEST_STEP * fmax(fabs(goal), fabs(e->time))) {
        return rounding_step(e, goal);
    }
    return solver_step(e, goal, root);
}

/* Has a changed input carried an indicator to its other side? */
static int compare_indicators(vi_exchange *e, bool *changed)
{
    e->inputs_changed = 0;
    e->begins_anew = 1;
    const int status = vi_exchange_get_numbers(e, VI_EXCHANGE_INDICATORS, e->compared, e->indicator_count);
    for (int64_t i = 0; status == OK && i < e->indicator_count; i++) {
        *changed = *changed || (e->compared[i] > 0.0) != (e->indicators[i] > 0.0);
    }
    return status;
}

int vi_door_exchange_step(vi_exchange *e, double time, double size, bool no_state_prior, bool *event, bool *ends,
                          bool *early, double *last_time)
{
    const double target = time + size, room = SAME_INSTANT * (1.0 + fabs(time));
    *event = *ends = *early = false;
    *last_time = time;
    e->meets = 0;
    /* the instants of a step that ended early: its rest keeps none */
    e->sample_count = e->instant_count > 0 && e->instants[0] < time - room ? e->instant_count : 0;
    if (!(fabs(time - e->time) <= SAME_TIME * (1.0 + fabs(time)))) {
        return vi_exchange_refused(e, VI_EXCHANGE_SET_TIME, VI_EXCHANGE_TIME);
    }
    if (e->inputs_changed) {
        const int status = compare_indicators(e, event);
        if (status != OK) {
            return status;
        }
    }
    const bool has_time_event = e->next_event <= target + room;
    if (*event || e->ends || e->next_event <= e->time) { /* where the step begins */
        *ends = e->ends != 0;
        *event = !*ends;
        *early = true;
        return OK;
    }
    const double goal = has_time_event ? e->next_event : fmax(target, e->time);
    int64_t steps = 0, short_steps = 0;
    e->cause = -1;
    const int marked = vi_exchange_mark_watches(e);
    if (marked != OK) {
        return marked;
    }
    while (e->time < goal && !*event && !*ends && !e->meets) {
        if (steps++ == e->most_steps) {
            return vi_exchange_refused(e, VI_EXCHANGE_DERIVATIVES, VI_EXCHANGE_STEPS);
        }
        bool root, wants_event = false;
        const double before = e->time;
        int status = step_towards(e, goal, &root);
        if (e->time - before > ROUNDING * fabs(e->time)) {
            short_steps = 0;
            e->cause = -1;
        } else {
            short_steps++;
        }
        if (status == OK && short_steps > MOST_SHORT_STEPS) {
            return vi_exchange_refused(e, VI_EXCHANGE_DERIVATIVES, VI_EXCHANGE_SHORT);
        }
        status = status != OK ? status : vi_door_exchange_show(e, e->time, e->states);
        status = status != OK ? status : complete_step(e, no_state_prior, &wants_event, ends);
        status = status != OK ? status : vi_exchange_follow_watches(e);
        if (status != OK) {
            return status;
        }
        *event = root || wants_event;
    }
    *event = *event || (has_time_event && e->time >= goal);
    *last_time = fabs(e->time - target) <= room ? target : e->time;
    *early = *last_time < target;
    return vi_exchange_get_numbers(e, VI_EXCHANGE_INDICATORS, e->indicators, e->indicator_count);
}

/* ---- states ---- */

int vi_door_exchange_save(vi_exchange *e, void **slot)
{
    const size_t states = (size_t)e->state_count, indicators = (size_t)e->indicator_count;
    saved_state *s = *slot;
    if (s == NULL) {
        s = calloc(1, sizeof *s + sizeof(double) * (states + indicators + 2 * (size_t)e->watch_count));
        if (s == NULL) {
            return vi_exchange_refused(e, VI_EXCHANGE_SAVE, VI_EXCHANGE_STATUS);
        }
        *slot = s;
    }
    s->time = e->time;
    s->next_event = e->next_event;
    s->in_event_mode = e->in_event_mode;
    s->ends = e->ends;
    memcpy(s->numbers, e->states, sizeof(double) * states);
    if (indicators > 0) {
        memcpy(s->numbers + states, e->indicators, sizeof(double) * indicators);
    }
    for (int64_t k = 0; k < e->watch_count; k++) {
        s->numbers[states + indicators + 2 * (size_t)k] = e->watches[k].is_pressed;
        s->numbers[states + indicators + 2 * (size_t)k + 1] = e->watches[k].impulse;
    }
    return vi_exchange_judged(e, VI_EXCHANGE_SAVE,
                              vi_exchange_begin_call(e, VI_EXCHANGE_SAVE).save(e->fmu, &s->fmu_state));
}

int vi_door_exchange_restore(vi_exchange *e, void *slot)
{
    const saved_state *s = slot;
    const size_t states = (size_t)e->state_count, indicators = (size_t)e->indicator_count;
    e->time = s->time;
    e->next_event = s->next_event;
    e->in_event_mode = s->in_event_mode;
    e->ends = s->ends;
    e->begins_anew = 1; /* the history of the solver belongs to another motion */
    e->inputs_changed = 0;
    memcpy(e->states, s->numbers, sizeof(double) * states);
    if (indicators > 0) {
        memcpy(e->indicators, s->numbers + states, sizeof(double) * indicators);
    }
    for (int64_t k = 0; k < e->watch_count; k++) {
        e->watches[k].is_pressed = s->numbers[states + indicators + 2 * (size_t)k] != 0.0;
        e->watches[k].impulse = s->numbers[states + indicators + 2 * (size_t)k + 1];
    }
    e->gives_forces = e->force_count > 0;
    return vi_exchange_judged(e, VI_EXCHANGE_RESTORE,
                              vi_exchange_begin_call(e, VI_EXCHANGE_RESTORE).restore(e->fmu, s->fmu_state));
}

int vi_door_exchange_free(vi_exchange *e, void **slot)
{
    saved_state *s = *slot;
    int status = OK;
    if (s != NULL && s->fmu_state != NULL) {
        status = vi_exchange_judged(e, VI_EXCHANGE_FREE,
                                    vi_exchange_begin_call(e, VI_EXCHANGE_FREE).save(e->fmu, &s->fmu_state));
    }
    free(s);
    *slot = NULL;
    return status;
}
