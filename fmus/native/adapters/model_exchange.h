/* Model exchange for both versions of FMI: the importer integrates the instance's states. Refused calls are logged. */
#ifndef VIBROIMPACT_MODEL_EXCHANGE_H
#define VIBROIMPACT_MODEL_EXCHANGE_H

#include "instance.h"

/* Status of a call, with the numbers of fmi2Status and fmi3Status. */
typedef enum { VI_OK = 0, VI_DISCARD = 2, VI_ERROR = 3 } vi_status;

/* Arrays of numbers that an importer reads. */
typedef enum { VI_STATES, VI_NOMINALS, VI_DERIVATIVES, VI_INDICATORS } vi_numbers;

/* Make this an instance of model exchange, before any other call. */
void vi_instance_exchange(vi_instance *instance);

/* End initialization: false where this set-up cannot be integrated. */
bool vi_instance_begin_exchange(vi_instance *instance, const char *function);

/* Is this an instance of model exchange in one of these modes? */
bool vi_instance_expect_exchange(vi_instance *instance, const char *function, int modes);

/* Resolve the events at this instant. */
bool vi_instance_handle_event(vi_instance *instance, const char *function, bool *states_changed, bool *terminate);

bool vi_instance_enter_continuous_time(vi_instance *instance, const char *function);
bool vi_instance_set_time(vi_instance *instance, const char *function, double time);
bool vi_instance_set_states(vi_instance *instance, const char *function, const double states[], size_t count);

/* Read `count` numbers, which must be all of them. VI_DISCARD: the states, or values computed from them, are not
 * finite, and the importer can try a shorter step. */
vi_status vi_instance_read(vi_instance *instance, const char *function, vi_numbers which, double values[], size_t count);

/* Number of these numbers. */
bool vi_instance_count(vi_instance *instance, const char *function, vi_numbers which, size_t *count);

#endif
