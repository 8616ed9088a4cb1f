#include "exciter.h"

#include <math.h>

#include "exciter_variables.h"
#include "plain.h"

static void defaults(void *self)
{
    exciter *it = self;
    it->magnet.gain = 1.0;
    it->side = VI_MAGNET_LOWER;
}

static void update_outputs(void *self)
{
    exciter *it = self;
    it->magnet.side = (int)it->side;
    const bool apart = vi_magnet_gap(&it->magnet, it->displacement) > 0.0;
    it->force = apart ? vi_magnet_force(&it->magnet, it->input, it->displacement) : NAN;
}

/* A body on the exciter is no set-up that this law knows of; the next step says so. */
static bool is_apart(const exciter *it, char *message)
{
    if (!(vi_magnet_gap(&it->magnet, it->displacement) > 0.0)) {
        vi_complain(message, "displacement: expected a body that does not touch the exciter, %.17g m away at 0, got %.17g",
                    it->magnet.distance, it->displacement);
        return false;
    }
    return true;
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    exciter *it = self;
    message[0] = '\0';
    vi_check_finite(message, "gain", it->magnet.gain);
    vi_check_finite(message, "offset", it->magnet.offset);
    vi_check_not_negative(message, "distance", it->magnet.distance);
    if (it->side != VI_MAGNET_LOWER && it->side != VI_MAGNET_UPPER) {
        vi_complain(message, "side: expected 1 (lower) or 2 (upper), got %lld", (long long)it->side);
    }
    it->magnet.side = (int)it->side;
    if (message[0] != '\0' || !is_apart(it, message)) {
        return false;
    }
    it->time = start_time;
    update_outputs(it);
    return true;
}

/* An exciter has no motion of its own: a step only carries its time along. */
static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    exciter *it = self;
    message[0] = '\0';
    if (!vi_plain_step_is_good(request, message) || !is_apart(it, message)) {
        return VI_STEP_ERROR;
    }
    it->time = request->time + request->size;
    update_outputs(it);
    return VI_STEP_DONE;
}

static double present_time(const void *self)
{
    return ((const exciter *)self)->time;
}

static size_t used_size(const void *self)
{
    (void)self;
    return sizeof(exciter);
}

const vi_component vi_this_component = {
    .name = EXCITER_NAME,
    .token = EXCITER_TOKEN,
    .variables = exciter_variables,
    .variable_count = EXCITER_VARIABLE_COUNT,
    .struct_size = sizeof(exciter),
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
