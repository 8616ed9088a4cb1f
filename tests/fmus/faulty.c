/* An integrator, y' = u, that misbehaves as told by `fault`, in every step that ends at or after `fault_time`. */
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>

#include "model.h"

enum { U = 1, Y, FAULT, FAULT_TIME };

/* As in the model descriptions. */
enum {
    FAULT_NONE,
    FAULT_ERROR,
    FAULT_FATAL,
    FAULT_DISCARD,
    FAULT_HANG,
    FAULT_LOG_FLOOD,
    FAULT_PRINT_FLOOD,
    FAULT_SEGFAULT,
    FAULT_ABORT,
    FAULT_EXIT,
    FAULT_NOT_A_NUMBER,
    FAULT_TERMINATE,
    FAULT_STALL,
    FAULT_ENDLESS_EVENTS,
    FAULT_REFUSE
};
enum { LOGGED_LINES = 1000000, PRINTED_LINES = 100000 };

const bool model_has_state = true;
const bool model_has_event_mode = true;

void model_start(model *m)
{
    *m = (model){.value = {[U] = 1.0}};
}

bool model_begin(model *m, void *instance)
{
    if ((int)m->value[FAULT] == FAULT_REFUSE) {
        say(instance, "refused", FAULT_REFUSE, m->value[FAULT_TIME]);
        return false;
    }
    return true;
}

void model_calculate(model *m)
{
    (void)m;
}

static void hang(void)
{
    volatile bool forever = true;
    while (forever) {
    }
}

static void crash(void)
{
    /* a debugger or a sanitizer may have put a handler there */
    signal(SIGSEGV, SIG_DFL);
    volatile int *volatile nowhere = NULL;
    *nowhere = 1;
}

static void flood_log(double time, void *instance)
{
    for (int line = 1; line <= LOGGED_LINES; line++) {
        say(instance, "line", line, time);
    }
}

static void flood_output(void)
{
    for (int line = 1; line <= PRINTED_LINES; line++) {
        printf("printed line %d\n", line);
    }
    fflush(stdout);
}

static step_answer misbehave(model *m, double time, void *instance)
{
    const int fault = (int)m->value[FAULT];
    switch (fault) {
    case FAULT_ERROR:
        say(instance, "broken", fault, time);
        return STEP_FAILS;
    case FAULT_FATAL:
        say(instance, "broken", fault, time);
        return STEP_FATAL;
    case FAULT_DISCARD:
        return STEP_DISCARDS;
    case FAULT_HANG:
        hang();
        break;
    case FAULT_LOG_FLOOD:
        flood_log(time, instance);
        break;
    case FAULT_PRINT_FLOOD:
        flood_output();
        break;
    case FAULT_SEGFAULT:
        crash();
        break;
    case FAULT_ABORT:
        abort();
    case FAULT_EXIT:
        exit(0);
    case FAULT_NOT_A_NUMBER:
        m->value[Y] = NAN;
        break;
    case FAULT_TERMINATE:
        return STEP_TERMINATES;
    case FAULT_STALL:
        return STEP_STALLS;
    case FAULT_ENDLESS_EVENTS:
        return STEP_NEEDS_EVENT;
    default:
        break;
    }
    return STEP_DONE;
}

step_answer model_step(model *m, double size, void *instance)
{
    const double end = m->time + size;
    const bool due = end >= m->value[FAULT_TIME];
    const step_answer answer = due ? misbehave(m, end, instance) : STEP_DONE;
    if (answer == STEP_DISCARDS) {
        size /= 2;
    }
    if (answer != STEP_STALLS) {
        m->value[Y] += size * m->value[U];
    }
    return answer;
}

bool model_update(model *m)
{
    if ((int)m->value[FAULT] != FAULT_ENDLESS_EVENTS || m->time < m->value[FAULT_TIME]) {
        return false;
    }
    /* another value each time, so that waiting for outputs that stay the same does not help either */
    m->value[Y] = m->value[Y] > 0.0 ? -1.0 : 1.0;
    return true;
}
