/* A step that ends early for want of budget and is continued equals the whole step bit for bit. A motion that stands
 * still or overflows is given up. */
#include "body/modal/modal_scan.h"
#include "body/modal/pressed_flow.h"
#include "body/modal/structure/structure.h"

#include <math.h>
#include <string.h>

#include "check.h"

static vi_structure_model model;
static vi_structure_state state;
static vi_contact contacts[VI_PORTS];
static vi_record record;
static vi_pressed_cache pressed;
static vi_scan scan;

/* A body that rattles between two elastic stops, with many impacts. */
static vi_structure rattling(int modes, double gap)
{
    memset(&model, 0, sizeof model);
    memset(&state, 0, sizeof state);
    memset(contacts, 0, sizeof contacts);
    memset(&record, 0, sizeof record);
    CHECK(vi_clock_start(&model.clock, 0.7, 0.0, 1.0), "%s", "clock");
    model.modes = modes;
    model.contacts = 2;
    model.tolerance = 1e-10;
    for (int j = 0; j < modes; ++j) {
        vi_structure_mode(&model, j, 1.0 + 2.0 * j, 0.01, 0.3, 0.7);
        model.shape[0][j] = model.impulse[0][j] = j == 0 ? 1.0 : 0.3;
        model.shape[1][j] = model.impulse[1][j] = j == 0 ? 1.0 : 0.3;
        model.observed[j] = 1.0;
    }
    for (int k = 0; k < 2; ++k) {
        contacts[k].law = vi_contact_law_rigid(1.0);
        contacts[k].side = k == 0 ? VI_SIDE_UPPER : VI_SIDE_LOWER;
        contacts[k].position = k == 0 ? gap : -gap;
    }
    state.p[0] = 1.0;
    vi_structure_prepare(&model);
    const vi_structure s = {&model, &state, contacts, &record, &pressed, &scan, NULL, NULL, {0, NULL, NULL, NULL}, NULL};
    vi_structure_start(&s, (vi_instant){0, 0.0, 0.0});
    return s;
}

/* The same body under a force with a slope: an input that must not start anew. */
static vi_structure begin(int modes, double gap)
{
    const double held[VI_MODES] = {0.1}, slope[VI_MODES] = {0.01};
    const vi_structure s = rattling(modes, gap);
    vi_structure_hold(&s, held, slope);
    return s;
}

static void a_step_in_pieces_is_the_step(int modes)
{
    const vi_instant target = {2, 0.25, 0.0};
    const vi_step_request early = {0.0, 1.0, false, true}, late = {0.0, 1.0, false, false};
    vi_structure s = begin(modes, 1e-5);
    CHECK(vi_structure_advance(&s, target, &late) == VI_STEP_DONE, "%s", "the whole step");
    const vi_structure_state whole = state;
    const int64_t count = contacts[0].count;
    int pieces = 0;
    vi_step_result result;
    s = begin(modes, 1e-5);
    do {
        result = vi_structure_advance(&s, target, &early);
        pieces += 1;
        CHECK(state.budget.unfinished == (result == VI_STEP_UNFINISHED), "piece %d", pieces);
    } while (result == VI_STEP_UNFINISHED);
    CHECK(result == VI_STEP_DONE && pieces > 1 && contacts[0].count == count, "%d in %d pieces", (int)result, pieces);
    CHECK(memcmp(&state, &whole, sizeof state) == 0, "%d modes, %d pieces go another way: %.17g and %.17g", modes, pieces,
          state.q[0], whole.q[0]);
}

static void numbers_that_overflow_are_given_up(void)
{
    const vi_step_request request = {0.0, 1.0, false, true};
    const vi_structure one = rattling(1, 1.0);
    vi_structure_mode(&model, 0, 1e100, 0.0, 0.3, 0.7); /* its fourth derivative is of size 1e401 */
    state.p[0] = 1e101;
    vi_structure_prepare(&model);
    CHECK(vi_structure_advance(&one, (vi_instant){100, 0.0, 0.0}, &request) == VI_STEP_NOT_FINITE, "%s", "one mode");
    const vi_structure s = rattling(2, 1.0);
    vi_structure_mode(&model, 1, 1e100, 0.01, 0.3, 0.7);
    state.q[1] = 0.1;
    vi_structure_prepare(&model);
    const vi_step_result result = vi_structure_advance(&s, (vi_instant){100, 0.0, 0.0}, &request);
    CHECK(result == VI_STEP_NOT_FINITE, "two modes: %d", (int)result);
}

static void the_limit_counts_every_event_of_all_steps(void)
{
    const vi_step_request request = {0.0, 1.0, false, true};
    const vi_structure s = begin(1, 0.1);
    model.impact_limit = 1000;
    vi_step_result result = VI_STEP_DONE;
    for (int n = 1; n < 1000 && result == VI_STEP_DONE; ++n) {
        result = vi_structure_advance(&s, (vi_instant){n, 0.0, 0.0}, &request);
    }
    CHECK(result == VI_STEP_IMPACT_LIMIT && state.budget.events == 1000, "%d at %lld", (int)result,
          (long long)state.budget.events);
}

static void long_work_without_progress_is_given_up(void)
{
    const vi_step_request request = {0.0, 1.0, false, true};
    vi_clock clock;
    vi_budget budget;
    CHECK(vi_clock_start(&clock, 1.0, 0.0, 1.0), "%s", "clock");
    vi_budget_start(&budget, (vi_instant){3, 0.5, 0.0});
    int steps = 0;
    vi_step_result result = VI_STEP_UNFINISHED;
    while (result == VI_STEP_UNFINISHED && ++steps < 1000) {
        do {
            vi_budget_spend(&budget, 1 << 12);
            result = vi_budget_look(&budget, &clock, (vi_instant){3, 0.5, 1e-18 * steps}, 0, &request);
        } while (result == VI_STEP_DONE);
        vi_budget_end(&budget, result);
    }
    CHECK(result == VI_STEP_CRAWL && steps > 1 && steps < 1000, "%d after %d steps", (int)result, steps);
}

int main(void)
{
    a_step_in_pieces_is_the_step(1);
    a_step_in_pieces_is_the_step(2);
    numbers_that_overflow_are_given_up();
    the_limit_counts_every_event_of_all_steps();
    long_work_without_progress_is_given_up();
    return 0;
}
