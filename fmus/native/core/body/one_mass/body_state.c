#include "body/one_mass/body_state.h"

#include <math.h>

#include "body/landing.h"

double vi_body_held_now(const vi_body *body)
{
    return body->held + body->held_rate * vi_clock_elapsed(&body->clock, body->held_since, body->now);
}

vi_phase vi_body_phase_now(const vi_body *body)
{
    return vi_phase_of(body->clock.angular_frequency * body->now.rest);
}

double vi_body_within(const vi_body *body, double displacement)
{
    for (int k = 0; k < VI_BODY_CONTACTS; ++k) {
        const double sign = vi_body_direction(body, k), stop = body->contacts[k].position;
        if (vi_body_watched(body, k) && sign * displacement > sign * stop) {
            displacement = stop;
        }
    }
    return displacement;
}

double vi_body_pressure_noise(const vi_body *body, double position)
{
    return VI_ROUNDING
           * (fabs(body->mode.force) + fabs(vi_body_held_now(body)) + body->mode.stiffness * fabs(position));
}
