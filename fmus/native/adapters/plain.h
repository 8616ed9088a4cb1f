/* What a component without events of its own gives to the adapters. */
#ifndef VIBROIMPACT_PLAIN_H
#define VIBROIMPACT_PLAIN_H

#include "component.h"

/* Has the step a finite end after its start? If not, the message says so. */
bool vi_plain_step_is_good(const vi_step_request *request, char message[VI_MESSAGE_LENGTH]);

/* Nothing follows from a variable that was set but the outputs. */
void vi_plain_was_set(void *self, uint32_t value_reference);

/* Nothing is pending, ever. */
bool vi_plain_resolve(void *self, char message[VI_MESSAGE_LENGTH]);
bool vi_plain_never(const void *self);

#endif
