#include "analog_input.h"

#include <math.h>

#include "analog_input_variables.h"
#include "plain.h"

static void defaults(void *self)
{
    analog_input *it = self;
    it->clock.rate = 1000.0;
    it->highest = 10.0;
    it->bits = 16;
    it->sample = -1;
    it->event_time = NAN;
}

/* The output does not follow the input: samples are taken at edges. */
static void update_outputs(void *self)
{
    (void)self;
}

static void sample_now(analog_input *it, int64_t edge)
{
    it->output = vi_digitised(it->input, it->highest, (int)it->bits);
    it->sample = edge;
    it->pending = 0;
}

static void check_parameters(const analog_input *it, char *message)
{
    vi_check_positive(message, "rate", it->clock.rate);
    vi_check_finite(message, "clock_error", it->clock.clock_error);
    if (!(it->clock.clock_error > -1e6)) {
        vi_complain(message, "clock_error: expected a number > -1e6, got %.17g", it->clock.clock_error);
    }
    vi_check_not_negative(message, "skew", it->clock.skew);
    vi_check_positive(message, "range", it->highest);
    if (!(it->bits >= VI_FEWEST_BITS && it->bits <= VI_MOST_BITS)) {
        vi_complain(message, "bits: expected %d to %d, got %lld", VI_FEWEST_BITS, VI_MOST_BITS, (long long)it->bits);
    }
}

/* Before the first edge the output is the start value, rounded like all samples. */
static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    analog_input *it = self;
    check_parameters(it, message);
    vi_check_finite(message, "start time", start_time);
    if (message[0] != '\0') {
        return false;
    }
    it->time = start_time;
    it->event_time = NAN;
    const int64_t first = vi_sample_after(&it->clock, start_time);
    it->next = first > 0 ? first : 0;
    const int64_t last = it->next - 1;
    const bool here = last >= 0 && vi_sample_time(&it->clock, last) >= start_time;
    sample_now(it, here ? last : -1);
    it->pending = here;
    return true;
}

static bool resolve(void *self, char message[VI_MESSAGE_LENGTH])
{
    analog_input *it = self;
    (void)message;
    if (it->pending) {
        sample_now(it, it->next - 1);
    }
    return true;
}

/* With event mode a step ends at an edge, where the input is set anew; otherwise edges in a step sample its input. */
static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    analog_input *it = self;
    if (!vi_plain_step_is_good(request, message)) {
        return VI_STEP_ERROR;
    }
    const double end = request->time + request->size, edge = vi_sample_time(&it->clock, it->next);
    const int64_t after = vi_sample_after(&it->clock, end);
    it->time = end;
    it->event_time = NAN;
    it->pending = 0;
    if (after <= it->next) {
        return VI_STEP_DONE;
    }
    it->event_time = edge;
    if (request->stop_at_contacts && request->early_return) {
        it->time = fmin(edge, end);
        it->next += 1;
        it->pending = 1;
        return VI_STEP_CONTACT;
    }
    it->next = after;
    sample_now(it, after - 1);
    return VI_STEP_DONE;
}

static bool event_pending(const void *self)
{
    return ((const analog_input *)self)->pending != 0;
}

const vi_component vi_this_component = {
    .defaults = defaults,
    .initialize = initialize,
    .update_outputs = update_outputs,
    .step = step,
    .resolve = resolve,
    .event_pending = event_pending,
};
