#include "body/one_mass/rest.h"

#include <math.h>

#include "motion/majorant.h"

double vi_body_time_to_release(const vi_body *body, int k, double length, bool *released)
{
    const double sign = vi_contact_direction(body->contacts[k].side), w = body->clock.angular_frequency;
    const double stop = body->contacts[k].position, held = vi_body_held_now(body);
    const double force = fabs(body->mode.force), fourth = force * w * w * w * w;
    const double noise = vi_body_pressure_noise(body, stop);
    double u = 0.0;
    *released = false;
    for (int evaluation = 0; u < length && evaluation < VI_MOST_EVALUATIONS; ++evaluation) {
        double pressure, slope;
        const vi_phase phase = vi_phase_of(w * (body->now.rest + u));
        vi_mode_held(&body->mode, stop, phase, held + body->held_rate * u, body->held_rate, &pressure, &slope);
        pressure = fmax(0.0, sign * pressure);
        const double closing = -sign * slope;
        const double bend = sign * body->mode.force * w * w * phase.cosine;
        if (closing > 0.0 && pressure <= noise) {
            if (bend < 0.0 && closing * closing <= -2.0 * bend * (pressure + noise)) {
                /* the pressure falls to zero and rises again: it stays */
                u = fmin(length, u + closing / -bend + sqrt(noise / -bend));
                continue;
            }
            *released = true;
            return fmin(length, u + pressure / closing);
        }
        const double twist = -sign * body->mode.force * w * w * w * phase.sine;
        const vi_approach state = {pressure, closing, bend, twist, fourth};
        const double step = vi_certified_step(&state, length - u);
        if (u + step == u) {
            return length; /* no pressure and no trend: it stays */
        }
        u = step < length - u ? u + step : length;
    }
    return u;
}

bool vi_body_pressed_for_ever(const vi_body *body, int k)
{
    const double constant = vi_body_held_now(body) - body->mode.stiffness * body->contacts[k].position;
    return body->held_rate == 0.0 && vi_contact_direction(body->contacts[k].side) * constant > fabs(body->mode.force);
}

bool vi_body_lifted(const vi_body *body, int k)
{
    double pressure, slope;
    const double stop = body->contacts[k].position;
    vi_mode_held(&body->mode, stop, vi_body_phase_now(body), vi_body_held_now(body), body->held_rate, &pressure, &slope);
    return vi_contact_direction(body->contacts[k].side) * pressure < -vi_body_pressure_noise(body, stop);
}
