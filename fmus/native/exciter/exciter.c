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

/* The law does not hold for a body on the exciter; the next step says so. */
static void check_gap(const exciter *it, char *message)
{
    if (!(vi_magnet_gap(&it->magnet, it->displacement) > 0.0)) {
        vi_complain(message, "displacement: expected a body that does not touch the exciter, %.17g m away at 0, got %.17g",
                    it->magnet.distance, it->displacement);
    }
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    exciter *it = self;
    vi_check_finite(message, "gain", it->magnet.gain);
    vi_check_finite(message, "offset", it->magnet.offset);
    vi_check_not_negative(message, "distance", it->magnet.distance);
    if (it->side != VI_MAGNET_LOWER && it->side != VI_MAGNET_UPPER) {
        vi_complain(message, "side: expected 1 (lower) or 2 (upper), got %lld", (long long)it->side);
    }
    it->magnet.side = (int)it->side;
    if (message[0] == '\0') {
        check_gap(it, message);
    }
    return vi_plain_start(self, start_time, message);
}

static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    if (vi_plain_step_is_good(request, message)) {
        check_gap(self, message);
    }
    return message[0] == '\0' ? vi_plain_step(self, request, message) : VI_STEP_ERROR;
}

const vi_component vi_this_component = {
    .defaults = defaults,
    .initialize = initialize,
    .update_outputs = update_outputs,
    .step = step,
};
