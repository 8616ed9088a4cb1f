#include "gain.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>

#include "component.h"
#include "gain_variables.h"

static void defaults(void *self)
{
    ((gain *)self)->factor = 1.0;
}

static void was_set(void *self, uint32_t value_reference)
{
    (void)self;
    (void)value_reference;
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
    if (!(request->size > 0.0) || !isfinite(request->time + request->size)) {
        (void)snprintf(message, VI_MESSAGE_LENGTH, "communicationStepSize: expected a finite number > 0, got %.17g",
                       request->size);
        return VI_STEP_ERROR;
    }
    known->time = request->time + request->size;
    update_outputs(known);
    return VI_STEP_DONE;
}

static bool resolve(void *self, char message[VI_MESSAGE_LENGTH])
{
    (void)self;
    message[0] = '\0';
    return true;
}

static bool never(const void *self)
{
    (void)self;
    return false;
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
    .was_set = was_set,
    .update_outputs = update_outputs,
    .step = step,
    .resolve = resolve,
    .event_pending = never,
    .needs_events = never,
    .time = present_time,
    .used_size = used_size,
};
