#include "plain.h"

#include <math.h>
#include <stdio.h>

bool vi_plain_step_is_good(const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    if (request->size > 0.0 && isfinite(request->time + request->size)) {
        return true;
    }
    (void)snprintf(message, VI_MESSAGE_LENGTH, "communicationStepSize: expected a finite number > 0, got %.17g",
                   request->size);
    return false;
}

void vi_plain_was_set(void *self, uint32_t value_reference)
{
    (void)self;
    (void)value_reference;
}

bool vi_plain_resolve(void *self, char message[VI_MESSAGE_LENGTH])
{
    (void)self;
    message[0] = '\0';
    return true;
}

bool vi_plain_never(const void *self)
{
    (void)self;
    return false;
}
