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
    const sensor *it = self;
    vi_check_finite(message, "gain", it->reading.gain);
    vi_check_finite(message, "offset", it->reading.offset);
    vi_check_not_negative(message, "range", it->reading.highest);
    return vi_plain_start(self, start_time, message);
}

const vi_component vi_this_component = {
    .defaults = defaults,
    .initialize = initialize,
    .update_outputs = update_outputs,
    .step = vi_plain_step,
};
