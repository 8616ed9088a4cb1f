/* A step of an FMU for model exchange, in the form of a co-simulation step: CVODE integrates between events.
 *
 * The functions of the FMU and of CVODE come as addresses, so that this library links neither. A step ends early at an
 * event; the importer then calls enter, update and leave, as for an FMU of FMI 3.0 with event mode. Each function
 * returns a status of FMI; where it is an error, `function` and `reason` explain it.
 */
#ifndef VIBROIMPACT_MODEL_EXCHANGE_H
#define VIBROIMPACT_MODEL_EXCHANGE_H

#include <stdbool.h>

#include "door/door.h"
#include "door/model_exchange_calls.h"

/* Begin a run at `time` (s): the FMU has left initialization mode. */
VI_DOOR int vi_door_exchange_begin(vi_exchange *exchange, double time);
/* Free the solver. */
VI_DOOR void vi_door_exchange_end(vi_exchange *exchange);
/* Advance as fmi3DoStep does. */
VI_DOOR int vi_door_exchange_step(vi_exchange *exchange, double time, double size, bool no_state_prior, bool *event,
                                  bool *ends, bool *early, double *last_time);
/* Event mode, in the forms of FMI 3.0. */
VI_DOOR int vi_door_exchange_enter(vi_exchange *exchange);
VI_DOOR int vi_door_exchange_update(vi_exchange *exchange, bool *again, bool *ends, bool *nominals, bool *values,
                                    bool *has_next, double *next);
VI_DOOR int vi_door_exchange_leave(vi_exchange *exchange);
/* States by value: the FMU's own, and the solver's. */
VI_DOOR int vi_door_exchange_save(vi_exchange *exchange, void **slot);
VI_DOOR int vi_door_exchange_restore(vi_exchange *exchange, void *slot);
VI_DOOR int vi_door_exchange_free(vi_exchange *exchange, void **slot);

#endif
