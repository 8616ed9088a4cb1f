#include "body/budget.h"

#include <float.h>
#include <math.h>

/* Evaluations after which a step ends early: some hundredths of a second of computation. */
static const int64_t STEP_EVALUATIONS = (int64_t)1 << 20;
/* Evaluations after which a step is given up when the importer does not let steps end early: about a minute. */
static const int64_t MOST_STEP_EVALUATIONS = (int64_t)1 << 30;
/* Evaluations within which time must advance by more than its rounding, or the step is given up: several seconds. */
static const int64_t PATIENCE = (int64_t)1 << 26;

void vi_budget_start(vi_budget *budget, vi_instant now)
{
    *budget = (vi_budget){.mark = now};
}

/* Has time advanced since the mark by no more than the rounding of its number? Moves the mark. */
static bool crawls(vi_budget *budget, const vi_clock *clock, vi_instant now)
{
    const double advanced = vi_clock_elapsed(clock, budget->mark, now);
    const double least = DBL_EPSILON * (fabs(vi_clock_time(clock, now)) + clock->period);
    budget->since_mark = -budget->spent;
    budget->mark = now;
    return !(advanced > least);
}

vi_step_result vi_budget_look(vi_budget *budget, const vi_clock *clock, vi_instant now, int64_t event_limit,
                              const vi_step_request *request)
{
    if (event_limit > 0 && budget->events >= event_limit) {
        return VI_STEP_IMPACT_LIMIT;
    }
    if (budget->spent < STEP_EVALUATIONS) {
        return VI_STEP_DONE;
    }
    if (budget->since_mark + budget->spent >= PATIENCE && crawls(budget, clock, now)) {
        return VI_STEP_CRAWL;
    }
    return request->early_return || budget->spent >= MOST_STEP_EVALUATIONS ? VI_STEP_UNFINISHED : VI_STEP_DONE;
}

vi_step_result vi_budget_end(vi_budget *budget, vi_step_result result)
{
    budget->since_mark += budget->spent;
    budget->spent = 0;
    budget->unfinished = result == VI_STEP_UNFINISHED || result == VI_STEP_RECORD_FULL;
    return result;
}

void vi_complain_of_end(char message[VI_MESSAGE_LENGTH], vi_step_result result, double time)
{
    if (result == VI_STEP_CRAWL) {
        vi_complain(message, "time: expected a motion that goes on, got no more than the rounding of time %.17g s in"
                             " %lld evaluations. Look for parameters many orders of magnitude apart", time,
                    (long long)PATIENCE);
    } else if (result == VI_STEP_NOT_FINITE) {
        vi_complain(message, "motion: expected finite numbers, got displacements or their rates of change beyond"
                             " 1.8e308 after time %.17g s. Look for parameters of extreme size", time);
    }
}
