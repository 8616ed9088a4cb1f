/* The loop over coupled components. Clocks of both FMI versions tick at instants of their own: the loop meets all
 * instants in order. For any answers of the components the loop returns, and time never goes back. */
#include "door/coupling.h"

#include <math.h>
#include <string.h>

#include "check.h"

enum { MOST = 4, EVENTS = 4096, VERSION_2 = 2, VERSION_3 = 3 };

/* A component with one input, the time of the clock before it, and one output, its own time. */
typedef struct {
    double time, period, event_time, input;
    int64_t ticks;
} clock_state;

typedef struct {
    clock_state state, saved;
    void *slot;
    double step_time, step_size, last_time;
    unsigned char flags[4], decisions[2];
    bool in_event_mode;
    double rounding; /* accepted difference of a given time, s: steps of one size add up otherwise */
    uint64_t *liar; /* NULL: all its answers are true */
} clock_fmu;

static clock_fmu clocks[MOST];
static vi_coupling_component components[MOST];
static vi_coupling_call inputs[MOST][2], states[MOST][2], times[MOST], begin[2 * MOST], again[MOST], leave[MOST];
static const unsigned char *decisions[MOST];
static double buffer[MOST], reported_time[MOST];
static const uint32_t reference = 1;
static int64_t noted_call;
static double noted_time;

static int lies(uint64_t *seed)
{
    static const int statuses[] = {0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4, -1};
    return statuses[choice(seed, sizeof statuses / sizeof *statuses)];
}

static double next_tick(const clock_state *s)
{
    return (double)(s->ticks + 1) * s->period;
}

static int step3(void *instance, double time, double size, bool no_state_prior, bool *event, bool *ends, bool *early,
                 double *reached)
{
    clock_fmu *c = instance;
    clock_state *s = &c->state;
    CHECK(no_state_prior && size > 0.0 && !c->in_event_mode, "%g", size);
    if (c->liar != NULL) {
        const double answers[] = {time, time + size, time + 0.5 * size, time - size, time + 2.0 * size, (double)NAN};
        *event = choice(c->liar, 3) == 0;
        *ends = choice(c->liar, 9) == 0;
        *early = choice(c->liar, 3) == 0;
        *reached = answers[*early ? choice(c->liar, 6) : 1];
        return lies(c->liar);
    }
    CHECK(fabs(time - s->time) <= c->rounding, "%.17g %.17g", time, s->time);
    *event = next_tick(s) <= time + size;
    *early = next_tick(s) < time + size;
    *ends = false;
    *reached = s->time = *event ? next_tick(s) : time + size;
    return 0;
}

static int step2(void *instance, double time, double size, int no_state_prior)
{
    clock_fmu *c = instance;
    clock_state *s = &c->state;
    CHECK(no_state_prior == 1 && size > 0.0, "%g", size);
    const double tick = next_tick(s);
    if (c->liar != NULL) {
        s->event_time = choice(c->liar, 2) == 0 ? (double)NAN : uniform(c->liar, time - size, time + 2.0 * size);
        return lies(c->liar);
    }
    CHECK(fabs(time - s->time) <= c->rounding, "%.17g %.17g", time, s->time);
    s->time = time + size;
    s->event_time = tick <= s->time ? tick : (double)NAN;
    s->ticks += tick == s->time;
    return 0;
}

static int enter_event_mode(void *instance)
{
    clock_fmu *c = instance;
    CHECK(!c->in_event_mode, "%g", c->state.time);
    c->in_event_mode = true;
    return 0;
}

static int update(void *instance, bool *again_wanted, bool *ends, bool *nominals, bool *values, bool *has_time,
                  double *time)
{
    clock_fmu *c = instance;
    CHECK(c->in_event_mode, "%g", c->state.time);
    const bool is_due = next_tick(&c->state) == c->state.time;
    c->state.ticks += is_due;
    *again_wanted = is_due || (c->liar != NULL && choice(c->liar, 2) == 0);
    *ends = *nominals = *values = *has_time = false;
    *time = 0.0;
    return c->liar != NULL ? lies(c->liar) : 0;
}

static int enter_step_mode(void *instance)
{
    clock_fmu *c = instance;
    CHECK(c->in_event_mode, "%g", c->state.time);
    c->in_event_mode = false;
    return 0;
}

static int save(void *instance, void **slot)
{
    clock_fmu *c = instance;
    c->saved = c->state;
    *slot = &c->saved;
    return 0;
}

static int restore(void *instance, void *slot)
{
    clock_fmu *c = instance;
    CHECK(slot == &c->saved, "%p", slot);
    c->state = c->saved;
    return 0;
}

static int moved(void *instance, const uint32_t which[], size_t count, double *value, bool is_input)
{
    clock_fmu *c = instance;
    CHECK(count == 1 && which[0] == reference, "%u", which[0]);
    *(is_input ? &c->state.input : value) = is_input ? *value : c->state.time;
    return 0;
}

static int get3(void *instance, const uint32_t which[], size_t count, void *values, size_t value_count)
{
    CHECK(value_count == 1, "%zu", value_count);
    return moved(instance, which, count, values, false);
}

static int set3(void *instance, const uint32_t which[], size_t count, void *values, size_t value_count)
{
    CHECK(value_count == 1, "%zu", value_count);
    return moved(instance, which, count, values, true);
}

static int get2(void *instance, const uint32_t which[], size_t count, void *values)
{
    return moved(instance, which, count, values, false);
}

static int set2(void *instance, const uint32_t which[], size_t count, void *values)
{
    return moved(instance, which, count, values, true);
}

static int get_event_time(void *instance, const uint32_t which[], size_t count, void *values)
{
    (void)which, (void)count;
    *(double *)values = ((clock_fmu *)instance)->state.event_time;
    return 0;
}

static vi_coupling_call call_of(int i, int kind, vi_coupling_function function, void *values)
{
    return (vi_coupling_call){.function = function,
                              .instance = &clocks[i],
                              .references = &reference,
                              .count = 1,
                              .values = values,
                              .value_count = 1,
                              .kind = kind,
                              .place = i,
                              .note = i + 1};
}

/* Set up clock `i`, whose input is the time of the clock before it. */
static void make(int i, int version, double period, uint64_t *liar)
{
    clock_fmu *c = &clocks[i];
    *c = (clock_fmu){.state = {.period = period}, .liar = liar};
    const bool is_3 = version == VERSION_3;
    const int before = i > 0 ? i - 1 : 0, move = is_3 ? VI_CALL_MOVE3 : VI_CALL_MOVE2;
    const bool before_is_3 = i > 0 && components[before].event_mode != 0;
    const vi_coupling_function get = {.move3 = get3}, get_old = {.move2 = get2}, set = {.move3 = set3},
                               set_old = {.move2 = set2};
    inputs[i][0] = call_of(before, before_is_3 ? VI_CALL_MOVE3 : VI_CALL_MOVE2, before_is_3 ? get : get_old,
                           &buffer[i]);
    inputs[i][1] = call_of(i, move, is_3 ? set : set_old, &buffer[i]);
    states[i][0] = call_of(i, VI_CALL_SAVE, (vi_coupling_function){.save = save}, &c->slot);
    states[i][1] = call_of(i, VI_CALL_RESTORE, (vi_coupling_function){.restore = restore}, &c->slot);
    times[i] = call_of(i, VI_CALL_MOVE2, (vi_coupling_function){.move2 = get_event_time}, &reported_time[i]);
    const vi_coupling_function step_3 = {.step3 = step3}, step_2 = {.step2 = step2};
    components[i] = (vi_coupling_component){
        .step = call_of(i, is_3 ? VI_CALL_STEP3 : VI_CALL_STEP2, is_3 ? step_3 : step_2, NULL),
        .inputs = {inputs[i], i > 0 ? 2 : 0},
        .save = {&states[i][0], 1},
        .restore = {&states[i][1], 1},
        .event_times = {&times[i], is_3 ? 0 : 1},
        .event_mode = is_3,
        .may_return_early = is_3,
        .step_time = &c->step_time,
        .step_size = &c->step_size,
        .last_time = &c->last_time,
        .flags = c->flags};
}

static vi_coupling_plan plan_of(int count)
{
    int32_t deciding = 0;
    for (int i = 0; i < count; ++i) {
        if (components[i].event_mode) {
            begin[deciding] = call_of(i, VI_CALL_PLAIN, (vi_coupling_function){.plain = enter_event_mode}, NULL);
            again[deciding] = call_of(i, VI_CALL_UPDATE, (vi_coupling_function){.update = update}, clocks[i].decisions);
            leave[deciding] = call_of(i, VI_CALL_PLAIN, (vi_coupling_function){.plain = enter_step_mode}, NULL);
            decisions[deciding++] = clocks[i].decisions;
        }
    }
    memcpy(begin + deciding, again, (size_t)deciding * sizeof *again);
    const size_t each = (size_t)deciding;
    return (vi_coupling_plan){.components = components,
                              .count = count,
                              .saves = 1,
                              .begin = {begin, 2 * each},
                              .again = {again, each},
                              .leave = {leave, each},
                              .decisions = decisions,
                              .deciding = deciding,
                              .most_iterations = 100,
                              .no_state_prior = 1,
                              .same_instant = 1e-13,
                              .time_rounding = 1e-9,
                              .step_rounding = 1e-6,
                              .noted_call = &noted_call,
                              .noted_time = &noted_time};
}

/* ---- claims ---- */

static double events[EVENTS][3];
static int32_t at_event[MOST];

static vi_coupling_run run_to(double end, double macro_step)
{
    return (vi_coupling_run){.end = end,
                             .macro_step = macro_step,
                             .most_seconds = 1e9,
                             .events = &events[0][0],
                             .events_room = EVENTS,
                             .at_event = at_event};
}

static vi_coupling_progress from_zero(double macro_step)
{
    return (vi_coupling_progress){.next_point = macro_step, .event_time = (double)-INFINITY};
}

/* Periods are multiples of 1/8: clocks sometimes tick together, at instants without rounding. */
static void every_clock_ticks_at_its_instants(uint64_t *seed)
{
    const int count = 1 + (int)choice(seed, MOST);
    const double macro_step = choice(seed, 2) == 0 ? (double)INFINITY : 0.125 * (1 + choice(seed, 40)), end = 100.0;
    for (int i = 0; i < count; ++i) {
        make(i, choice(seed, 2) == 0 ? VERSION_2 : VERSION_3, 0.125 * (1 + choice(seed, 40)), NULL);
    }
    const vi_coupling_plan plan = plan_of(count);
    vi_coupling_progress progress = from_zero(macro_step);
    vi_coupling_run run = run_to(end, macro_step);
    const int result = vi_door_coupling(&plan, &progress, &run);
    CHECK(result == VI_COUPLING_DONE && progress.time == end, "%d at %g", result, progress.time);
    int64_t ticks = 0;
    for (int i = 0; i < count; ++i) {
        const clock_state *s = &clocks[i].state;
        CHECK(s->ticks == (int64_t)floor(end / s->period) && s->time == end, "%d ticks of %g", (int)s->ticks,
              s->period);
        CHECK(i == 0 || s->input == end, "%g", s->input);
        ticks += s->ticks;
    }
    CHECK(ticks == run.events_used, "%d events, %d ticks", (int)run.events_used, (int)ticks);
    for (int64_t k = 1; k < ticks; ++k) {
        const bool is_same = events[k][0] == events[k - 1][0];
        CHECK(events[k][0] >= events[k - 1][0] && events[k][1] == (is_same ? events[k - 1][1] + 1.0 : 0.0), "%g",
              events[k][0]);
    }
}

/* With room for few events the loop leaves the step with an event too many to the caller, and goes on once it is
 * finished. */
static void events_without_room_are_left_to_the_caller(uint64_t *seed)
{
    make(0, VERSION_3, 0.5, NULL);
    const vi_coupling_plan plan = plan_of(1);
    vi_coupling_progress progress = from_zero(INFINITY);
    vi_coupling_run run = run_to(20.0, INFINITY);
    run.events_room = choice(seed, 7);
    const int result = vi_door_coupling(&plan, &progress, &run);
    const double left = 0.5 * (double)(run.events_room + 1);
    CHECK(result == VI_COUPLING_REACHED && run.arrived == 1 && run.reached == left, "%d at %g", result, run.reached);
    CHECK(run.events_used == run.events_room && progress.time == left - 0.5, "%g", progress.time);
}

/* A component with one step size gets exactly this size, and no step cut by another's event or by the end. */
static void a_component_of_one_step_size_is_given_no_other(uint64_t *seed)
{
    const double step = 1e-3, period = 1e-3 * (1.5 + (double)choice(seed, 40));
    make(0, VERSION_3, choice(seed, 2) == 0 ? period : 1e9, NULL);
    make(1, choice(seed, 2) == 0 ? VERSION_2 : VERSION_3, 1e9, NULL);
    components[1].only_step = step;
    clocks[1].rounding = 1e-16;
    const vi_coupling_plan plan = plan_of(2);
    vi_coupling_progress progress = from_zero(step);
    vi_coupling_run run = run_to(0.1, step);
    const int result = vi_door_coupling(&plan, &progress, &run);
    if (clocks[0].state.period == period) {
        CHECK(result == VI_COUPLING_CUT && run.at == 1, "%d at %d", result, run.at);
        CHECK(clocks[1].state.time < period && run.goal == period, "%g of %g", run.goal, period);
    } else {
        CHECK(result == VI_COUPLING_DONE && clocks[1].step_size == step, "%d, %.17g", result, clocks[1].step_size);
    }
}

/* For any answers the loop returns with one of its reasons, and no time goes back or beyond the end. */
static void liars_end_the_loop_and_never_hold_it(uint64_t *seed)
{
    const int count = 1 + (int)choice(seed, MOST);
    for (int i = 0; i < count; ++i) {
        make(i, choice(seed, 2) == 0 ? VERSION_2 : VERSION_3, 0.3, seed);
    }
    const vi_coupling_plan plan = plan_of(count);
    vi_coupling_progress progress = from_zero(0.25);
    vi_coupling_run run = run_to(50.0, 0.25);
    run.hears_pauses = (int32_t)choice(seed, 2);
    double before = 0.0;
    for (int call = 0; call < 20; ++call) {
        const int result = vi_door_coupling(&plan, &progress, &run);
        CHECK(result >= VI_COUPLING_DONE && result <= VI_COUPLING_ENDLESS, "%d", result); /* all take any size */
        CHECK(progress.time >= before && progress.time <= run.end, "%g after %g", progress.time, before);
        CHECK(result != VI_COUPLING_FAILED || run.status < 0 || run.status > 1, "%d", run.status);
        CHECK(run.arrived <= count && run.events_used <= EVENTS, "%d", run.arrived);
        before = progress.time;
        run.events_used = 0;
        for (int i = 0; i < count; ++i) {
            clocks[i].in_event_mode = false;
        }
    }
}

int main(void)
{
    uint64_t seed = 20261126u;
    for (int k = 0; k < 300; ++k) {
        every_clock_ticks_at_its_instants(&seed);
        events_without_room_are_left_to_the_caller(&seed);
        a_component_of_one_step_size_is_given_no_other(&seed);
    }
    for (int k = 0; k < 3000; ++k) {
        liars_end_the_loop_and_never_hold_it(&seed);
    }
    return 0;
}
