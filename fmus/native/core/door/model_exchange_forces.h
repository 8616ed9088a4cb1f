/* Stops that yield, in the derivatives of an FMU for model exchange: the law of a stop gives the force on its body. */
#ifndef VIBROIMPACT_MODEL_EXCHANGE_FORCES_H
#define VIBROIMPACT_MODEL_EXCHANGE_FORCES_H

#include <stdbool.h>

#include "door/model_exchange_calls.h"

/* The force of a stop at the values of the watched variables, N: below 0 where the stop would pull. */
double vi_exchange_stop_force(const vi_exchange *exchange, const vi_exchange_watch *watch);
/* Do forces of stops belong to the derivatives now, or are inputs to be set back to 0? */
bool vi_exchange_has_forces(const vi_exchange *exchange);
/* Set the force inputs at the present point, whose watched variables are read first. */
int vi_exchange_give_forces(vi_exchange *exchange);
/* Let the FMU have these states at `time`, in continuous-time mode, and the forces that they cause; the integration
 * stays where it is. */
VI_DOOR int vi_door_exchange_show(vi_exchange *exchange, double time, const double states[]);
/* Add the impulses of the pressing stops over a step of CVODE from `before`, s, at four Gauss points. */
int vi_exchange_add_impulses(vi_exchange *exchange, double before);

#endif
