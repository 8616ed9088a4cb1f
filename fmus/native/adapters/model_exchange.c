#include "model_exchange.h"

#include <math.h>

/* Does the component have states? If not, only its `set_time` is called. */
static bool has_states(void)
{
    return vi_this_component.exchange->states != NULL;
}

void vi_instance_exchange(vi_instance *instance)
{
    instance->exchange = true;
    if (has_states()) {
        vi_this_component.exchange->enable(instance->self);
    }
}

bool vi_instance_begin_exchange(vi_instance *instance, const char *function)
{
    char reason[VI_MESSAGE_LENGTH] = "";
    return !has_states() || vi_this_component.exchange->begin(instance->self, reason)
           || vi_instance_fail(instance, function, "%s", reason);
}

bool vi_instance_expect_exchange(vi_instance *instance, const char *function, int modes)
{
    if (instance != NULL && !instance->exchange) {
        return vi_instance_fail(instance, function, "not allowed: the instance was made for co-simulation. Advance it by"
                                " doStep, or make one for model exchange");
    }
    return vi_instance_expect(instance, function, modes);
}

/* ---- events and time ---- */

bool vi_instance_handle_event(vi_instance *instance, const char *function, bool *states_changed, bool *terminate)
{
    if (!has_states()) {
        *states_changed = *terminate = false;
        instance->outputs_stale = true;
        return true;
    }
    if (!vi_this_component.exchange->states_are_finite(instance->self)) {
        return vi_instance_fail(instance, function, "expected finite states, got others");
    }
    instance->message[0] = '\0';
    instance->outputs_stale = true;
    return vi_this_component.exchange->handle_event(instance->self, states_changed, terminate, instance->message)
           || vi_instance_fail(instance, function, "%s", instance->message);
}

bool vi_instance_enter_continuous_time(vi_instance *instance, const char *function)
{
    if (!vi_instance_expect_exchange(instance, function, VI_MODE_EVENT)) {
        return false;
    }
    if (has_states()) {
        vi_this_component.exchange->go_on(instance->self);
    }
    instance->mode = VI_MODE_CONTINUOUS;
    return true;
}

bool vi_instance_set_time(vi_instance *instance, const char *function, double time)
{
    if (!vi_instance_expect_exchange(instance, function, VI_MODE_EVENT | VI_MODE_CONTINUOUS)) {
        return false;
    }
    instance->outputs_stale = true;
    return vi_this_component.exchange->set_time(instance->self, time)
           || vi_instance_fail(instance, function, "expected a time below 2^53 forcing periods, got %.17g", time);
}

/* ---- arrays of numbers ---- */

static size_t count_of(const vi_instance *instance, vi_numbers which)
{
    const vi_model_exchange *exchange = vi_this_component.exchange;
    if (!has_states()) {
        return 0;
    }
    return which == VI_INDICATORS ? exchange->indicators(instance->self) : exchange->states(instance->self);
}

static bool expect_numbers(vi_instance *instance, const char *function, int modes, vi_numbers which,
                           const double values[], size_t given)
{
    if (!vi_instance_expect_exchange(instance, function, modes)) {
        return false;
    }
    if (instance->mode == VI_MODE_INITIALIZATION) {
        vi_instance_refresh(instance);
    }
    const size_t needed = count_of(instance, which);
    if (given != needed || (values == NULL && needed > 0)) {
        return vi_instance_fail(instance, function, "expected %lu values, got %lu", (unsigned long)needed,
                                (unsigned long)(values == NULL ? 0 : given));
    }
    return true;
}

bool vi_instance_set_states(vi_instance *instance, const char *function, const double states[], size_t count)
{
    if (!expect_numbers(instance, function, VI_MODE_CONTINUOUS, VI_STATES, states, count)) {
        return false;
    }
    if (count > 0) {
        vi_this_component.exchange->set_states(instance->self, states);
    }
    instance->outputs_stale = true;
    return true;
}

/* Are the states and all values computed from them finite? If not, warn. */
static bool is_finite(vi_instance *instance, const char *function, const double values[], size_t count)
{
    bool finite = vi_this_component.exchange->states_are_finite(instance->self);
    for (size_t i = 0; i < count; ++i) {
        finite = finite && isfinite(values[i]);
    }
    if (!finite) {
        vi_instance_warn(instance, function,
                         "expected finite states, and finite values of them, got others. Try a shorter step");
    }
    return finite;
}

vi_status vi_instance_read(vi_instance *instance, const char *function, vi_numbers which, double values[], size_t count)
{
    const vi_model_exchange *exchange = vi_this_component.exchange;
    if (!expect_numbers(instance, function, VI_MODE_INITIALIZATION | VI_RUNNING, which, values, count)) {
        return VI_ERROR;
    }
    if (!has_states()) {
        return VI_OK;
    }
    switch (which) {
    case VI_STATES: exchange->get_states(instance->self, values); return VI_OK;
    case VI_NOMINALS: exchange->get_nominals(instance->self, values); return VI_OK;
    case VI_DERIVATIVES: exchange->get_derivatives(instance->self, values); break;
    case VI_INDICATORS: exchange->get_indicators(instance->self, values); break;
    }
    return is_finite(instance, function, values, count) ? VI_OK : VI_DISCARD;
}

bool vi_instance_count(vi_instance *instance, const char *function, vi_numbers which, size_t *count)
{
    if (count == NULL || !vi_instance_expect_exchange(instance, function, VI_ANY_MODE)) {
        return false;
    }
    *count = count_of(instance, which);
    return true;
}
