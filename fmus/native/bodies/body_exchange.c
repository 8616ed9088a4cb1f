#include "body_exchange.h"

#include "body.h"

static vi_exchange_body exchanged(void *self)
{
    vi_body *c = vi_body_of(self);
    vi_exchange_body body = {.parts = vi_body_parts(c), .contacts = c->contacts_described, .scale = 1.0};
    vi_this_body.show_states(self, &body);
    body.refused = body.refused == NULL && c->record_energies ? "record.energies" : body.refused;
    return body;
}

void vi_body_show_indicators(void *self)
{
    const vi_exchange_body body = exchanged(self);
    vi_exchange_show_indicators(&body);
}

static size_t states(void *self)
{
    return 2 * (size_t)exchanged(self).modes;
}

static size_t indicators(void *self)
{
    return (size_t)exchanged(self).contacts;
}

static void enable(void *self)
{
    const vi_exchange_body body = exchanged(self);
    vi_exchange_enable(&body);
}

static bool begin(void *self, char message[VI_MESSAGE_LENGTH])
{
    const vi_exchange_body body = exchanged(self);
    return vi_exchange_begin(&body, message);
}

static bool set_time(void *self, double time)
{
    const vi_exchange_body body = exchanged(self);
    return vi_exchange_set_time(&body, time);
}

static void get_states(void *self, double values[])
{
    const vi_exchange_body body = exchanged(self);
    vi_exchange_get_states(&body, values);
}

static void set_states(void *self, const double values[])
{
    const vi_exchange_body body = exchanged(self);
    vi_exchange_set_states(&body, values);
}

static bool states_are_finite(void *self)
{
    const vi_exchange_body body = exchanged(self);
    return vi_exchange_states_are_finite(&body);
}

static void get_nominals(void *self, double nominals[])
{
    const vi_exchange_body body = exchanged(self);
    vi_exchange_get_nominals(&body, nominals);
}

static void get_derivatives(void *self, double derivatives[])
{
    const vi_exchange_body body = exchanged(self);
    vi_body_refresh_inputs(self);
    vi_exchange_get_derivatives(&body, derivatives);
}

static void get_indicators(void *self, double values[])
{
    const vi_exchange_body body = exchanged(self);
    vi_body_refresh_inputs(self);
    vi_exchange_get_indicators(&body, values);
}

static bool handle_event(void *self, bool *changed, bool *limit, char message[VI_MESSAGE_LENGTH])
{
    const vi_exchange_body body = exchanged(self);
    vi_body_refresh_inputs(self);
    return vi_exchange_event(&body, changed, limit, message);
}

static void go_on(void *self)
{
    const vi_exchange_body body = exchanged(self);
    vi_exchange_go_on(&body);
}

const vi_model_exchange vi_body_exchange = {
    .states = states,
    .indicators = indicators,
    .enable = enable,
    .begin = begin,
    .set_time = set_time,
    .get_states = get_states,
    .set_states = set_states,
    .states_are_finite = states_are_finite,
    .get_nominals = get_nominals,
    .get_derivatives = get_derivatives,
    .get_indicators = get_indicators,
    .handle_event = handle_event,
    .go_on = go_on,
};
