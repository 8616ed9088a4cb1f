/* A body of N modes with stops. It flies on the exact flow of its modes, meets one or several stops at once, and yields
 * to compliant stops. It chatters, sticks and is released. body/modal/state.h lists its parts. */
#ifndef VIBROIMPACT_STRUCTURE_H
#define VIBROIMPACT_STRUCTURE_H

#include "body/modal/state.h"
#include "body/step.h"

/* Begin at an instant, after q, p and the contacts' parameters are set. Clears the other state except `held`. */
void vi_structure_start(const vi_structure *s, vi_instant now);

/* Advance to `target`; step.h lists the reasons for an earlier end. */
vi_step_result vi_structure_advance(const vi_structure *s, vi_instant target, const vi_step_request *request);

/* Resolve the pending contact with its answer. */
void vi_structure_resolve(const vi_structure *s);

/* Contacts' outputs, and the modal accelerations, at the present instant. */
void vi_structure_outputs(const vi_structure *s, double acceleration[VI_MODES]);

#endif
