#include "plain.h"

#include <math.h>

static void go_to(void *self, double time)
{
    *(double *)(void *)((char *)self + vi_this_description.time) = time;
    vi_this_component.update_outputs(self);
}

bool vi_plain_start(void *self, double start_time, const char message[VI_MESSAGE_LENGTH])
{
    if (message[0] != '\0') {
        return false;
    }
    go_to(self, start_time);
    return true;
}

bool vi_plain_step_is_good(const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    if (request->size > 0.0 && isfinite(request->time + request->size)) {
        return true;
    }
    vi_complain(message, "communicationStepSize: expected a finite number > 0, got %.17g", request->size);
    return false;
}

vi_step_result vi_plain_step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    if (!vi_plain_step_is_good(request, message)) {
        return VI_STEP_ERROR;
    }
    go_to(self, request->time + request->size);
    return VI_STEP_DONE;
}
