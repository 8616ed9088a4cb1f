/* The end of a motion that grows: where it can meet no stop any more, or passes a limit. equations.md 1.9 */
#ifndef VIBROIMPACT_STRUCTURE_UNBOUNDED_H
#define VIBROIMPACT_STRUCTURE_UNBOUNDED_H

#include "body/modal/coupled_flow.h"
#include "body/modal/modal_flight.h"
#include "body/modal/state.h"

/* Does a motion that may grow become unbounded within *u seconds of a flight, or of a drift? *u is then the first such
 * instant, and state->unbounded has the reason. `meets`: the flight ends at a contact. */
bool vi_unbounded_flight(const vi_structure *s, const vi_flight *flight, const vi_point points[], bool meets,
                         double *u);
bool vi_unbounded_drift(const vi_structure *s, const vi_drift *drift, double *u);

/* Say why the motion has ended at `time`, s, after VI_STEP_UNBOUNDED. */
void vi_complain_of_growth(const vi_structure *s, char message[VI_MESSAGE_LENGTH], double time);

#endif
