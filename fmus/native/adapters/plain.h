/* A component without a motion of its own: its outputs follow from its inputs and the time, which a step only carries along. */
#ifndef VIBROIMPACT_PLAIN_H
#define VIBROIMPACT_PLAIN_H

#include "component.h"

/* The end of `initialize`, after its checks: start, unless they have complained. */
bool vi_plain_start(void *self, double start_time, const char message[VI_MESSAGE_LENGTH]);

/* Has the step a finite end after its start? If not, the message says so. */
bool vi_plain_step_is_good(const vi_step_request *request, char message[VI_MESSAGE_LENGTH]);

/* The step of such a component, which may begin and end anywhere. */
vi_step_result vi_plain_step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH]);

#endif
