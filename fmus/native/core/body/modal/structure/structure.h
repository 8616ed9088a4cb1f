/* A body of N modes with stops: flies on the exact flow of its modes, meets its stops (several at once too), yields to
 * compliant ones, chatters, sticks and is released. body/modal/state.h says what it is made of. */
#ifndef VIBROIMPACT_STRUCTURE_H
#define VIBROIMPACT_STRUCTURE_H

#include "body/modal/state.h"
#include "body/step.h"

/* Begin at an instant; q and p, the contacts' parameters are set. Clears everything else of the state but `held`. */
void vi_structure_start(const vi_structure *s, vi_instant now);

/* Advance to `target`. See step.h for what may end it earlier. */
vi_step_result vi_structure_advance(const vi_structure *s, vi_instant target, const vi_step_request *request);

/* Resolve the pending contact with its answer. */
void vi_structure_resolve(const vi_structure *s);

/* Contacts' outputs, and the modal accelerations, at the present instant. */
void vi_structure_outputs(const vi_structure *s, double acceleration[VI_MODES]);

#endif
