/* Stops that take another motion while a body moves. */
#ifndef VIBROIMPACT_STRUCTURE_MOVED_STOPS_H
#define VIBROIMPACT_STRUCTURE_MOVED_STOPS_H

#include <stdbool.h>

#include "body/modal/state.h"

/* Take changed motions from now on. Frequencies and velocities change the motion from its present phase and place on;
 * other changes move the stop at once. False, with the contact's number, where a rigid stop would cut a body. */
bool vi_structure_move_stops(const vi_structure *s, const vi_stop_motion motion[], int *contact);

#endif
