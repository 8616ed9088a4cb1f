/* Long rests: a body that stays on one stop, held or pressed, is taken as far as nothing can happen. */
#ifndef VIBROIMPACT_STRUCTURE_PRESSED_H
#define VIBROIMPACT_STRUCTURE_PRESSED_H

#include "body/modal/state.h"

/* Follow a rest by its exact flow, at most `length` seconds: up to there, or to shortly before the contact may end
 * or another begin. Returns the time, s, where the body is then; 0 where it is followed by series: it rests on
 * several stops, on a power law, not for long yet, or something is about to happen. `room` after the end is
 * certified too. */
double vi_structure_rest_on(const vi_structure *s, double length, double room);

#endif
