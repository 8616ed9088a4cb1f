/* How much a step may compute before its importer is heard again, and whether time comes forward at all.
 *
 * Counted in evaluations of one mode, not in seconds, so that the same step ends at the same place on every machine. A
 * step that has spent its budget ends early; the next one is its rest and goes on as if there had been no end.
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
    int64_t events;     /* of contacts since the start: impacts, grazes, touch-downs, rests */
    int64_t unfinished; /* the last step ended for no reason of the motion: the next one is its rest */
} vi_budget;

static inline void vi_budget_spend(vi_budget *budget, int64_t evaluations)
{
    budget->spent += evaluations;
}

void vi_budget_start(vi_budget *budget, vi_instant now);

/* VI_STEP_DONE when a step may go on at `now`; else how it ends. event_limit: 0: none. */
vi_step_result vi_budget_look(vi_budget *budget, const vi_clock *clock, vi_instant now, int64_t event_limit,
                              const vi_step_request *request);

/* A step ends with this result, which is returned. */
vi_step_result vi_budget_end(vi_budget *budget, vi_step_result result);

/* Say why a step was given up at `time`, s: VI_STEP_CRAWL or VI_STEP_NOT_FINITE. */
void vi_complain_of_end(char message[VI_MESSAGE_LENGTH], vi_step_result result, double time);

#endif
