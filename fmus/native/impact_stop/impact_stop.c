#include "impact_stop.h"

#include <math.h>
#include <stdio.h>

#include "component.h"
#include "impact_stop_variables.h"

static void defaults(void *self)
{
    impact_stop *stop = self;
    stop->law.law = VI_LAW_RESTITUTION;
    stop->law.restitution = 1.0;
    stop->applied_restitution = 1.0;
}

static void was_set(void *self, uint32_t value_reference)
{
    (void)self;
    (void)value_reference;
}

static void update_outputs(void *self)
{
    impact_stop *stop = self;
    stop->applied_restitution = vi_contact_law_restitution(&stop->law, fabs(stop->velocity));
    stop->applied_force = 0.0;
}

static bool initialize(void *self, double start_time, char message[VI_MESSAGE_LENGTH])
{
    impact_stop *stop = self;
    message[0] = '\0';
    if (!vi_contact_law_known(stop->law.law)) {
        (void)snprintf(message, VI_MESSAGE_LENGTH, "law: expected 1 (restitution), got %lld",
                       (long long)stop->law.law);
        return false;
    }
    if (!(stop->law.restitution >= 0.0 && stop->law.restitution <= 1.0)) {
        (void)snprintf(message, VI_MESSAGE_LENGTH, "restitution: expected 0 <= r <= 1, got %.17g",
                       stop->law.restitution);
        return false;
    }
    stop->time = start_time;
    update_outputs(stop);
    return true;
}

/* A stop has no motion of its own: a step only carries its time along. */
static vi_step_result step(void *self, const vi_step_request *request, char message[VI_MESSAGE_LENGTH])
{
    impact_stop *stop = self;
    if (!(request->size > 0.0) || !isfinite(request->time + request->size)) {
        (void)snprintf(message, VI_MESSAGE_LENGTH, "communicationStepSize: expected a finite number > 0, got %.17g",
                       request->size);
        return VI_STEP_ERROR;
    }
    stop->time = request->time + request->size;
    update_outputs(stop);
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
    return ((const impact_stop *)self)->time;
}

static size_t used_size(const void *self)
{
    (void)self;
    return sizeof(impact_stop);
}

const vi_component vi_this_component = {
    .name = IMPACT_STOP_NAME,
    .token = IMPACT_STOP_TOKEN,
    .variables = impact_stop_variables,
    .variable_count = IMPACT_STOP_VARIABLE_COUNT,
    .struct_size = sizeof(impact_stop),
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
