/* Long rests: a body that stays on its stop, held or pressed, is moved up to the next possible event in one step. */
#ifndef VIBROIMPACT_STRUCTURE_PRESSED_H
#define VIBROIMPACT_STRUCTURE_PRESSED_H

#include "body/modal/state.h"

/* Follow a rest by its exact flow, at most `length` seconds, and end shortly before the contact may end or another
 * begin. Returns the time followed, s. 0 means that series must follow the body: it presses on a power law, has not
 * rested long, or an event is near. `room` after the end is certified too. */
double vi_structure_rest_on(const vi_structure *s, double length, double room);

#endif
