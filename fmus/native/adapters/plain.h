/* Components without a motion of their own: outputs follow from inputs and time; a step only advances the time. */
#ifndef VIBROIMPACT_PLAIN_H
#define VIBROIMPACT_PLAIN_H

#include "component.h"

/* End `initialize` after its checks: start, unless a check has complained. */
bool vi_plain_start(void *self, double start_time, const char message[VI_MESSAGE_LENGTH]);

/* Does the step have a finite end after its start? If not, the message says so. */
bool vi_plain_step_is_good(const vi_step_request *request, char message[VI_MESSAGE_LENGTH]);

/* The step of such a component, which may begin and end at any time. */
vi_step_result vi_plain_step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH]);

#endif
