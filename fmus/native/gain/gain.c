#include "gain.h"

#include <math.h>
#include <stdbool.h>

#include "plain.h"
#include "gain_variables.h"

static void defaults(void *self)
{
    ((gain *)self)->factor = 1.0;
}

static void update_outputs(void *self)
{
    gain *known = self;
    known->output = known->factor * known->input;
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    gain *known = self;
    message[0] = '\0';
    vi_check_finite(message, "gain", known->factor);
    if (message[0] != '\0') {
        return false;
    }
    known->time = start_time;
    update_outputs(known);
    return true;
}

/* A gain has no motion of its own: a step only carries its time along. */
static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    gain *known = self;
    if (!vi_plain_step_is_good(request, message)) {
        return VI_STEP_ERROR;
    }
    known->time = request->time + request->size;
    update_outputs(known);
    return VI_STEP_DONE;
}

static double present_time(const void *self)
{
    return ((const gain *)self)->time;
}

static size_t used_size(const void *self)
{
    (void)self;
    return sizeof(gain);
}

const vi_component vi_this_component = {
    .name = GAIN_NAME,
    .token = GAIN_TOKEN,
    .variables = gain_variables,
    .variable_count = GAIN_VARIABLE_COUNT,
    .struct_size = sizeof(gain),
    .defaults = defaults,
    .initialize = initialize,
    .was_set = vi_plain_was_set,
    .update_outputs = update_outputs,
    .step = step,
    .resolve = vi_plain_resolve,
    .event_pending = vi_plain_never,
    .needs_events = vi_plain_never,
    .time = present_time,
    .used_size = used_size,
};
