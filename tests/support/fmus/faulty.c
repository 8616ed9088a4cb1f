/* An integrator, y' = u, with the fault `fault` in every step that ends at or after `fault_time`. With `fault_place`
 * the fault comes in that call, after `fault_after` good calls in this process. Two variables of the environment bring
 * a fault before parameters can be set: VIBROIMPACT_FAULTY_LOAD, VIBROIMPACT_FAULTY_INSTANTIATE. */
#if defined(__linux__)
#define _GNU_SOURCE
#endif
#include <fenv.h>
#include <math.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "model.h"

enum { U = 1, Y, FAULT, FAULT_TIME, FAULT_PLACE, FAULT_AFTER, SAYS_EARLY };

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
    FAULT_REFUSE,
    FAULT_SAYS_NAN,
    FAULT_SAYS_INFINITE,
    FAULT_SAYS_BEYOND,
    FAULT_SAYS_START,
    FAULT_SAYS_PAST,
    FAULT_END_SHORT,
    FAULT_FORK,
    FAULT_FORK_AWAY,
    FAULT_ROUND_UPWARD,
    FAULT_FLUSH_TO_ZERO,
    FAULT_STRANGE_LOG,
    FAULT_CORRUPT_HEAP,
    FAULT_STOP_PROCESS,
    FAULT_CLOSE_FILES,
    FAULT_KILL_PARENT,
    FAULT_ENDLESS_LOG,
    FAULT_BY_INPUT,
    FAULT_PENDING,
    FAULT_SHORT_STEPS
};
/* s; the longest step with FAULT_SHORT_STEPS */
#define LONGEST 0.1
/* s; a false end of a step, beyond every run */
#define BEYOND 360000.0
#define PAST (-1e9)
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

static void log_endlessly(double time, void *instance)
{
    volatile bool forever = true;
    while (forever) {
        flood_log(time, instance);
    }
}

static void flood_output(void)
{
    for (int line = 1; line <= PRINTED_LINES; line++) {
        printf("printed line %d\n", line);
    }
    fflush(stdout);
}

/* Start a process that stays, in this one's session or in one of its own. */
static void start_process(bool away)
{
    if (fork() == 0) {
        if (away) {
            setsid();
        }
        for (;;) {
            pause();
        }
    }
}

static void flush_to_zero(void)
{
#if defined(__x86_64__)
    __builtin_ia32_ldmxcsr(__builtin_ia32_stmxcsr() | 0x8040u);
#endif
}

/* Log a line that is no text, one without words, and one longer than any buffer. */
static void log_strangely(double time, void *instance)
{
    static char word[100000];
    memset(word, 'x', sizeof word - 1);
    say(instance, word, 1, time);
    say(instance, "\xff\xfe\x80 %s %n \x1b[31m", 2, time);
    say(instance, "", 3, NAN);
}

static void corrupt_heap(void)
{
    signal(SIGSEGV, SIG_DFL);
    char *block = malloc(24);
    /* hidden from the compiler, which would refuse it */
    char *volatile inside = block + 8;
    free(inside);
}

static void close_files(void)
{
    for (int file = 0; file < 256; file++) {
        close(file);
    }
}

/* Do a fault that is possible in any call; false: the fault is another one. */
static bool misbehave_anywhere(int fault, double time, void *instance)
{
    switch (fault) {
    case FAULT_HANG:
        hang();
        return true;
    case FAULT_LOG_FLOOD:
        flood_log(time, instance);
        return true;
    case FAULT_PRINT_FLOOD:
        flood_output();
        return true;
    case FAULT_SEGFAULT:
        crash();
        return true;
    case FAULT_ABORT:
        abort();
    case FAULT_EXIT:
        exit(0);
    case FAULT_FORK:
    case FAULT_FORK_AWAY:
        start_process(fault == FAULT_FORK_AWAY);
        return true;
    case FAULT_ROUND_UPWARD:
        fesetround(FE_UPWARD);
        return true;
    case FAULT_FLUSH_TO_ZERO:
        flush_to_zero();
        return true;
    case FAULT_STRANGE_LOG:
        log_strangely(time, instance);
        return true;
    case FAULT_CORRUPT_HEAP:
        corrupt_heap();
        return true;
    case FAULT_STOP_PROCESS:
        raise(SIGSTOP);
        return true;
    case FAULT_CLOSE_FILES:
        close_files();
        return true;
    case FAULT_KILL_PARENT:
        kill(getppid(), SIGKILL);
        return true;
    case FAULT_ENDLESS_LOG:
        log_endlessly(time, instance);
        return true;
    default:
        return false;
    }
}

static step_answer says(model *m, double time)
{
    m->reached = time;
    m->says_early = m->value[SAYS_EARLY] > 0.0;
    return STEP_SAYS;
}

/* Return the fault of this call; with `by_input` one input of a hundred brings each of three faults. */
static int asked_for(const model *m)
{
    if ((int)m->value[FAULT] != FAULT_BY_INPUT) {
        return (int)m->value[FAULT];
    }
    const int fault = (int)m->value[U] % 100;
    return fault == FAULT_HANG || fault == FAULT_SEGFAULT || fault == FAULT_NOT_A_NUMBER ? fault : FAULT_NONE;
}

static step_answer misbehave(model *m, double time, void *instance)
{
    const int fault = asked_for(m);
    if (misbehave_anywhere(fault, time, instance)) {
        return STEP_DONE;
    }
    switch (fault) {
    case FAULT_ERROR:
        say(instance, "broken", fault, time);
        return STEP_FAILS;
    case FAULT_FATAL:
        say(instance, "broken", fault, time);
        return STEP_FATAL;
    case FAULT_DISCARD:
        return STEP_DISCARDS;
    case FAULT_NOT_A_NUMBER:
        m->value[Y] = NAN;
        break;
    case FAULT_PENDING:
        m->says_early = m->value[SAYS_EARLY] > 0.0;
        return STEP_PENDS;
    case FAULT_TERMINATE:
        return STEP_TERMINATES;
    case FAULT_STALL:
        return STEP_STALLS;
    case FAULT_ENDLESS_EVENTS:
        return STEP_NEEDS_EVENT;
    case FAULT_SAYS_NAN:
        return says(m, NAN);
    case FAULT_SAYS_INFINITE:
        return says(m, INFINITY);
    case FAULT_SAYS_BEYOND:
        return says(m, time + BEYOND);
    case FAULT_SAYS_START:
        return says(m, m->time);
    case FAULT_SAYS_PAST:
        return says(m, PAST);
    default:
        break;
    }
    return STEP_DONE;
}

/* Whether this call is faulty: the calls of this process after the first `fault_after` ones are. */
static bool is_due(const model *m, occasion where)
{
    static int calls[PLACES];
    return (int)m->value[FAULT_PLACE] == (int)where && ++calls[where] > (int)m->value[FAULT_AFTER];
}

step_answer model_at(model *m, occasion where, void *instance)
{
    const char *told = where == AT_INSTANTIATE ? getenv("VIBROIMPACT_FAULTY_INSTANTIATE") : NULL;
    if (told != NULL && atoi(told) == FAULT_REFUSE) {
        return STEP_FAILS;
    }
    if (told != NULL) {
        (void)misbehave_anywhere(atoi(told), 0.0, instance);
    }
    if (!is_due(m, where)) {
        return STEP_DONE;
    }
    const step_answer answer = misbehave(m, m->time, instance);
    return answer == STEP_FAILS || answer == STEP_FATAL || answer == STEP_DISCARDS ? answer : STEP_DONE;
}

step_answer model_step(model *m, double size, void *instance)
{
    const double end = m->time + size;
    const bool due = end >= m->value[FAULT_TIME] && is_due(m, AT_STEP);
    if (due && (int)m->value[FAULT] == FAULT_END_SHORT) {
        const double half = m->time + 0.5 * size;
        m->reached = m->value[FAULT_TIME] > m->time ? m->value[FAULT_TIME] : half;
        m->value[Y] += (m->reached - m->time) * m->value[U];
        return STEP_ENDS_SHORT;
    }
    if (due && (int)m->value[FAULT] == FAULT_SHORT_STEPS && size > LONGEST) {
        m->reached = m->time + LONGEST;
        m->value[Y] += LONGEST * m->value[U];
        return STEP_SHORT;
    }
    const step_answer answer = due ? misbehave(m, end, instance) : STEP_DONE;
    if (answer == STEP_DISCARDS) {
        size /= 2;
    }
    if (answer != STEP_STALLS) {
        m->value[Y] += size * m->value[U];
    }
    return answer;
}

/* Runs when the library is loaded. */
__attribute__((constructor)) static void load(void)
{
    const char *told = getenv("VIBROIMPACT_FAULTY_LOAD");
    if (told != NULL) {
        (void)misbehave_anywhere(atoi(told), 0.0, NULL);
    }
}

bool model_update(model *m)
{
    if ((int)m->value[FAULT] != FAULT_ENDLESS_EVENTS || m->time < m->value[FAULT_TIME]) {
        return false;
    }
    /* another value each time: the outputs never settle either */
    m->value[Y] = m->value[Y] > 0.0 ? -1.0 : 1.0;
    return true;
}
