#include "load_cell.h"

#include <math.h>
#include <stdio.h>

#include "load_cell_variables.h"
#include "plain.h"

static void defaults(void *self)
{
    ((load_cell *)self)->cell.settings.sensitivity = 1.0;
}

/* A new force is on the cell at once, but the cell's ringing needs time. */
static void update_outputs(void *self)
{
    load_cell *it = self;
    const double before = it->cell.force;
    it->cell.force = it->force;
    it->load = vi_cell_load(&it->cell);
    it->output = vi_cell_volts(&it->cell);
    it->cell.force = before;
}

static void check_range(char *message, const char *name, double value, double least, int largest)
{
    if (!((value >= least && value <= largest) || (value >= 0.0 && value <= 0.0))) {
        char lower[32] = "";
        if (least > 0.0) {
            (void)snprintf(lower, sizeof lower, "or %g ", least);
        }
        vi_complain(message, "%s: expected 0 %sto %d, got %.17g", name, lower, largest, value);
    }
}

static void check_parameters(const vi_cell_settings *given, char *message)
{
    vi_check_finite(message, "sensitivity", given->sensitivity);
    check_range(message, "natural_frequency", given->natural_frequency, VI_CELL_LEAST, VI_CELL_HIGHEST);
    check_range(message, "damping_ratio", given->damping_ratio, 0.0, VI_CELL_STRONGEST);
    vi_check_finite(message, "offset", given->offset);
    vi_check_finite(message, "drift", given->drift);
    check_range(message, "contact_duration", given->contact_duration, VI_CELL_LEAST, VI_CELL_LONGEST);
}

static void check_inputs(const load_cell *it, char *message)
{
    vi_check_finite(message, "force", it->force);
    vi_check_finite(message, "impulse", it->impulse);
    if (it->impulse - it->counted != 0.0 && !(it->cell.settings.contact_duration > 0.0)) {
        vi_complain(message, "contact_duration: expected a number > 0 where impacts come, got 0. A compliant stop gives a "
                             "force and needs none");
    }
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    load_cell *it = self;
    it->counted = it->impulse; /* impacts before the start are not counted */
    check_parameters(&it->cell.settings, message);
    check_inputs(it, message);
    vi_check_finite(message, "start time", start_time);
    if (message[0] != '\0') {
        return false;
    }
    vi_cell_start(&it->cell, start_time, it->force);
    update_outputs(it);
    return true;
}

/* Impacts of one step are one half sine, which begins with the last of them. */
static bool take_impacts(load_cell *it, double end, double slope)
{
    const double impulse = it->impulse - it->counted;
    it->counted = it->impulse;
    if (!(impulse > 0.0 || impulse < 0.0)) {
        return true;
    }
    vi_cell_advance(&it->cell, fmin(fmax(it->impact_time, it->cell.time), end), slope);
    return vi_cell_hit(&it->cell, impulse);
}

static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    load_cell *it = self;
    if (vi_plain_step_is_good(request, message)) {
        check_inputs(it, message);
    }
    if (message[0] != '\0') {
        return VI_STEP_ERROR;
    }
    const double end = request->time + request->size;
    const double slope = (it->force - it->cell.force) / request->size;
    it->cell.time = request->time;
    if (!take_impacts(it, end, slope)) {
        vi_complain(message, "impulse: expected at most %d impacts within one contact_duration (%.17g s), got more. Take a"
                             " shorter contact_duration", VI_CELL_PULSES, it->cell.settings.contact_duration);
        return VI_STEP_ERROR;
    }
    vi_cell_advance(&it->cell, end, slope);
    it->cell.force = it->force;
    update_outputs(it);
    return VI_STEP_DONE;
}

static size_t used_size(const void *self)
{
    return sizeof(load_cell) - vi_cell_unused(&((const load_cell *)self)->cell);
}

const vi_component vi_this_component = {
    .defaults = defaults,
    .initialize = initialize,
    .update_outputs = update_outputs,
    .step = step,
    .used_size = used_size,
};
