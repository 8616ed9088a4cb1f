#include "sensor.h"

#include "plain.h"
#include "sensor_variables.h"

static void defaults(void *self)
{
    ((sensor *)self)->reading.gain = 1.0;
}

static void update_outputs(void *self)
{
    sensor *it = self;
    it->output = vi_reading_of(&it->reading, it->input);
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    sensor *it = self;
    message[0] = '\0';
    vi_check_finite(message, "gain", it->reading.gain);
    vi_check_finite(message, "offset", it->reading.offset);
    vi_check_not_negative(message, "range", it->reading.highest);
    if (message[0] != '\0') {
        return false;
    }
    it->time = start_time;
    update_outputs(it);
    return true;
}

/* A sensor has no motion of its own: a step only carries its time along. */
static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    sensor *it = self;
    if (!vi_plain_step_is_good(request, message)) {
        return VI_STEP_ERROR;
    }
    it->time = request->time + request->size;
    update_outputs(it);
    return VI_STEP_DONE;
}

static double present_time(const void *self)
{
    return ((const sensor *)self)->time;
}

static size_t used_size(const void *self)
{
    (void)self;
    return sizeof(sensor);
}

const vi_component vi_this_component = {
    .name = SENSOR_NAME,
    .token = SENSOR_TOKEN,
    .variables = sensor_variables,
    .variable_count = SENSOR_VARIABLE_COUNT,
    .struct_size = sizeof(sensor),
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
