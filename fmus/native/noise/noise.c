#include "noise.h"

#include <math.h>

#include "measuring/gaussian.h"
#include "noise_variables.h"
#include "plain.h"

/* A time closer to the next number than this part of the interval is at it, also where the summed steps of an importer
 * fall a little short of it. */
static const double SAME_INSTANT = 1e-4;

static void defaults(void *self)
{
    ((noise *)self)->rate = 1000.0;
}

/* Number `index` of the noise; those before time 0 have indices too. */
static double number(const noise *it)
{
    const double place = floor(it->time * it->rate + SAME_INSTANT);
    const double index = fmin(fmax(place, -0x1p62), 0x1p62);
    return vi_gaussian((uint64_t)it->seed, (uint64_t)it->channel, (uint64_t)(int64_t)index);
}

static void update_outputs(void *self)
{
    noise *it = self;
    it->output = it->rms > 0.0 ? it->input + it->rms * number(it) : it->input;
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    noise *it = self;
    message[0] = '\0';
    vi_check_not_negative(message, "rms", it->rms);
    vi_check_positive(message, "rate", it->rate);
    vi_check_finite(message, "start time", start_time);
    if (it->seed < 0) {
        vi_complain(message, "seed: expected a number >= 0, got %lld", (long long)it->seed);
    }
    if (it->channel < 0) {
        vi_complain(message, "channel: expected a number >= 0, got %lld", (long long)it->channel);
    }
    if (message[0] != '\0') {
        return false;
    }
    it->time = start_time;
    update_outputs(it);
    return true;
}

/* The noise follows the time alone: a step may begin and end anywhere. */
static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    noise *it = self;
    if (!vi_plain_step_is_good(request, message)) {
        return VI_STEP_ERROR;
    }
    it->time = request->time + request->size;
    update_outputs(it);
    return VI_STEP_DONE;
}

static double present_time(const void *self)
{
    return ((const noise *)self)->time;
}

static size_t used_size(const void *self)
{
    (void)self;
    return sizeof(noise);
}

const vi_component vi_this_component = {
    .name = NOISE_NAME,
    .token = NOISE_TOKEN,
    .variables = noise_variables,
    .variable_count = NOISE_VARIABLE_COUNT,
    .struct_size = sizeof(noise),
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
