/* Limits on the computation of a step, and the check that time advances at all.
 *
 * Work is counted in evaluations of one mode, not in seconds, so that a step ends at the same place on every machine. A
 * step that has spent its budget ends early. The next step continues it as if it had not ended.
 */
#ifndef VIBROIMPACT_BUDGET_H
#define VIBROIMPACT_BUDGET_H

#include <stdbool.h>
#include <stdint.h>

#include "body/complaint.h"
#include "body/step.h"
#include "motion/clock.h"

typedef struct {
    int64_t spent;      /* evaluations in this step */
    int64_t since_mark; /* evaluations since `mark` */
    vi_instant mark;
    int64_t events;     /* of contacts since the start: impacts, grazes, touch-downs, sticks */
    int64_t unfinished; /* the last step ended for want of budget or room; the next step continues it */
} vi_budget;

static inline void vi_budget_spend(vi_budget *budget, int64_t evaluations)
{
    budget->spent += evaluations;
}

void vi_budget_start(vi_budget *budget, vi_instant now);

/* VI_STEP_DONE when a step may go on at `now`; otherwise the result with which it ends. event_limit 0: no limit. */
vi_step_result vi_budget_look(vi_budget *budget, const vi_clock *clock, vi_instant now, int64_t event_limit,
                              const vi_step_request *request);

/* End a step with this result, which is returned. */
vi_step_result vi_budget_end(vi_budget *budget, vi_step_result result);

/* Say why a step was given up at `time`, s: VI_STEP_CRAWL or VI_STEP_NOT_FINITE. */
void vi_complain_of_end(char message[VI_MESSAGE_LENGTH], vi_step_result result, double time);

#endif
