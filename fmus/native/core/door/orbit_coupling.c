#include "door/orbit_coupling.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "modes/coupled_response.h"

VI_DOOR size_t vi_door_orbit_coupling_size(void)
{
    return sizeof(vi_orbit_coupling);
}

VI_DOOR size_t vi_door_orbit_coupling_work_size(void)
{
    return sizeof(vi_coupled_work);
}

static bool fill_body(int modes, const double natural[], const double coupling[], vi_pressed_body *body)
{
    memset(body, 0, sizeof *body);
    body->modes = modes;
    body->coupled = 1;
    bool good = true;
    for (int j = 0; j < modes; ++j) {
        body->square[j] = natural[j] * natural[j];
        good = good && natural[j] > 0.0 && isfinite(body->square[j]);
        for (int i = 0; i < modes; ++i) {
            body->coupling[j][i] = 0.5 * (coupling[j * modes + i] + coupling[i * modes + j]);
            good = good && isfinite(body->coupling[j][i]);
        }
    }
    return good;
}

VI_DOOR int vi_door_orbit_couple(int modes, double angular_frequency, const double natural[], const double coupling[],
                                 const double cosine[], const double sine[], vi_orbit_coupling *found,
                                 vi_coupled_work *work)
{
    if (modes < 1 || modes > VI_MODES || !fill_body(modes, natural, coupling, &found->body)) {
        return 1;
    }
    if (!vi_coupled_modes_find(&found->terms, &found->body, work)) {
        found->terms.terms = 0;
    }
    vi_coupled_equations equations;
    vi_complex load[VI_MODES], none[VI_PORTS] = {{0.0, 0.0}}, force[VI_PORTS];
    vi_coupled_equations_find(&equations, &found->body, (vi_complex){0.0, angular_frequency});
    for (int j = 0; j < modes; ++j) {
        load[j] = (vi_complex){cosine[j], -sine[j]};
    }
    vi_coupled_response(&equations, &found->body, load, none, found->steady, force);
    return 0;
}

void vi_orbit_turns(const vi_orbit_coupling *coupling, double u, vi_complex turn[])
{
    for (int m = 0; m < coupling->terms.terms; ++m) {
        const vi_complex rate = coupling->terms.rate[m];
        const double left = exp(rate.re * u);
        turn[m] = (vi_complex){left * cos(rate.im * u), left * sin(rate.im * u)};
    }
}

bool vi_orbit_recurring_parts(const vi_orbit_coupling *coupling, const double impulse[], double length,
                              vi_complex part[])
{
    const double rest[VI_MODES] = {0.0};
    vi_pressed_parts(&coupling->terms, rest, impulse, part);
    for (int m = 0; m < coupling->terms.terms; ++m) {
        const vi_complex rate = coupling->terms.rate[m];
        const double angle = rate.im * length, half = sin(0.5 * angle), gone = -expm1(rate.re * length);
        /* 1 - e^(rate length), free of cancellation at light damping */
        const vi_complex whole = {gone * cos(angle) + 2.0 * half * half, (gone - 1.0) * sin(angle)};
        /* an undamped term after whole turns: only rounding is left */
        if (!(vi_complex_size(whole) > 4.0 * DBL_EPSILON * (1.0 + vi_complex_size(rate) * length))) {
            return false;
        }
        part[m] = vi_complex_divide(part[m], whole);
    }
    return true;
}

void vi_orbit_turned_sum(const vi_orbit_coupling *coupling, const vi_complex part[], const vi_complex turn[],
                         double x[], double v[])
{
    vi_complex turned[VI_TERMS];
    for (int m = 0; m < coupling->terms.terms; ++m) {
        turned[m] = vi_complex_multiply(part[m], turn[m]);
    }
    vi_pressed_sum(&coupling->terms, turned, x, v);
}
