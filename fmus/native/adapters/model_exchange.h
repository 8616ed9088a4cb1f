/* Model exchange, as both versions of FMI have it: the importer integrates the instance's states. A call that is not
 * allowed is logged. */
#ifndef VIBROIMPACT_MODEL_EXCHANGE_H
#define VIBROIMPACT_MODEL_EXCHANGE_H

#include "instance.h"

/* The numbers are those of fmi2Status and fmi3Status. */
typedef enum { VI_OK = 0, VI_DISCARD = 2, VI_ERROR = 3 } vi_status;

/* Arrays of numbers that an importer reads. */
typedef enum { VI_STATES, VI_NOMINALS, VI_DERIVATIVES, VI_INDICATORS } vi_numbers;

/* Make it one of model exchange, before anything else is done with it. */
void vi_instance_exchange(vi_instance *instance);

/* Initialization has ended: false where this set-up cannot be integrated. */
bool vi_instance_begin_exchange(vi_instance *instance, const char *function);

/* Is it an instance of model exchange, and in one of these modes? */
bool vi_instance_expect_exchange(vi_instance *instance, const char *function, int modes);

/* Resolve what happens at this instant. */
bool vi_instance_handle_event(vi_instance *instance, const char *function, bool *states_changed, bool *terminate);

bool vi_instance_enter_continuous_time(vi_instance *instance, const char *function);
bool vi_instance_set_time(vi_instance *instance, const char *function, double time);
bool vi_instance_set_states(vi_instance *instance, const char *function, const double states[], size_t count);

/* `count` has to be how many there are. VI_DISCARD: the states, or what follows from them, are not finite, and the importer
 * can try a shorter step. */
vi_status vi_instance_read(vi_instance *instance, const char *function, vi_numbers which, double values[], size_t count);

/* How many numbers there are. */
bool vi_instance_count(vi_instance *instance, const char *function, vi_numbers which, size_t *count);

#endif
