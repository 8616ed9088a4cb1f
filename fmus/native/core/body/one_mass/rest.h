/* A body at rest on a stop: how long the contact force holds it there. equations.md 3.3 */
#ifndef VIBROIMPACT_REST_H
#define VIBROIMPACT_REST_H

#include "body/one_mass/body_state.h"

/* Seconds until the contact force on stop k (0-based) falls through zero, at most `length`; *released says whether it
 * does. A force that falls to zero and rises again holds. */
double vi_body_time_to_release(const vi_body *body, int k, double length, bool *released);

/* Does the pressure outlast every phase of the force? */
bool vi_body_pressed_for_ever(const vi_body *body, int k);

/* Have new inputs turned the contact force away from the stop at once? */
bool vi_body_lifted(const vi_body *body, int k);

#endif
