/* The strobes of a body: the instants at which its forcing has phase zero, as the ticks of an output clock (FMI 3.0).
 *
 * A description without the clock has no strobes. In event mode the clock ticks once at each strobe, also at the start.
 */
#ifndef VIBROIMPACT_BODY_STROBE_H
#define VIBROIMPACT_BODY_STROBE_H

#include <stdbool.h>
#include <stdint.h>

#include "body/step.h"
#include "motion/clock.h"

typedef struct {
    int32_t described; /* the model description has the clock */
    int32_t ticks;     /* the clock ticks now */
    int64_t passed;    /* whole periods at the last strobe that has ticked or was passed */
    double displacement, velocity; /* of the observed point at the last tick; before it, at the start */
} vi_strobe;

typedef struct vi_body vi_body;

/* Begin to count at the present instant. */
void vi_strobe_start(vi_body *body);

/* Has a strobe been reached, or passed in model exchange, that has not ticked? */
bool vi_strobe_is_due(const vi_body *body);

/* Move the target of a step back to the next strobe, if that comes first and the importer stops there. Was it moved? */
bool vi_strobe_ends_step(const vi_body *body, const vi_step_request *request, vi_instant *target);

/* A step has ended: strobes within the step, at which the importer could not stop, never tick. */
void vi_strobe_pass(vi_body *body, const vi_step_request *request);

/* Tick with the present outputs, if a strobe is due. Returns the time since the first strobe that has not ticked, s. */
double vi_strobe_tick(vi_body *body);

/* End the tick, and return the time of the next strobe, s; infinite: there is none. */
double vi_strobe_next(vi_body *body);

#endif
