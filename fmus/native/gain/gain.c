#include "gain.h"

#include "gain_variables.h"
#include "plain.h"

static void defaults(void *self)
{
    ((gain *)self)->factor = 1.0;
}

static void update_outputs(void *self)
{
    gain *it = self;
    it->output = it->factor * it->input;
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    vi_check_finite(message, "gain", ((const gain *)self)->factor);
    return vi_plain_start(self, start_time, message);
}

const vi_component vi_this_component = {
    .defaults = defaults,
    .initialize = initialize,
    .update_outputs = update_outputs,
    .step = vi_plain_step,
};
