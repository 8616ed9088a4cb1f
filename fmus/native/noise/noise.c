#include "noise.h"

#include <math.h>

#include "measuring/gaussian.h"
#include "noise_variables.h"
#include "plain.h"

/* Time to the next number, as a part of the interval, below which the time is at this number. Summed steps of an
 * importer may fall a little short of it. */
static const double SAME_INSTANT = 1e-4;

static void defaults(void *self)
{
    ((noise *)self)->rate = 1000.0;
}

/* Number `index` of the noise; times before 0 have indices too. */
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
    const noise *it = self;
    vi_check_not_negative(message, "rms", it->rms);
    vi_check_positive(message, "rate", it->rate);
    vi_check_finite(message, "start time", start_time);
    if (it->seed < 0) {
        vi_complain(message, "seed: expected a number >= 0, got %lld", (long long)it->seed);
    }
    if (it->channel < 0) {
        vi_complain(message, "channel: expected a number >= 0, got %lld", (long long)it->channel);
    }
    return vi_plain_start(self, start_time, message);
}

const vi_component vi_this_component = {
    .defaults = defaults,
    .initialize = initialize,
    .update_outputs = update_outputs,
    .step = vi_plain_step,
};
