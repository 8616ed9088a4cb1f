#include "beam_check.h"

#include <stdio.h>

#include "modes/beam_modes.h"

static void check_choice(char *message, const char *name, int64_t value, int most)
{
    if (value < 1 || value > most) {
        vi_complain(message, "%s: expected 1 to %d, got %lld", name, most, (long long)value);
    }
}

static void check_location(char *message, const char *name, double value)
{
    if (!(value >= 0.0 && value <= 1.0)) {
        vi_complain(message, "%s: expected 0 <= location <= 1 (a fraction of the length), got %.17g", name, value);
    }
}

/* Check the used parameters of the section. */
static void check_section(const beam *b, char *message)
{
    vi_check_positive(message, "length", b->length);
    vi_check_not_negative(message, "flexural_rigidity", b->flexural_rigidity);
    vi_check_not_negative(message, "mass_per_length", b->mass_per_length);
    const bool rigidity_follows = !(b->flexural_rigidity > 0.0), mass_follows = !(b->mass_per_length > 0.0);
    if (rigidity_follows) {
        vi_check_positive(message, "youngs_modulus", b->youngs_modulus);
    }
    if (mass_follows) {
        vi_check_positive(message, "density", b->density);
    }
    if (rigidity_follows || mass_follows) {
        vi_check_positive(message, "width", b->width);
        vi_check_positive(message, "thickness", b->thickness);
        if (!(b->poisson_ratio > -1.0 && b->poisson_ratio <= 0.5)) {
            vi_complain(message, "poisson_ratio: expected -1 < ratio <= 0.5, got %.17g", b->poisson_ratio);
        }
    }
}

static void check_modes(const beam *b, char *message)
{
    const int n = (int)b->modes;
    vi_check_each(message, vi_check_not_negative, "damping_ratio", b->damping_ratio, n);
    vi_check_not_negative(message, "rayleigh.mass", b->rayleigh_mass);
    vi_check_not_negative(message, "rayleigh.stiffness", b->rayleigh_stiffness);
    for (int j = 0; j < n; ++j) {
        vi_check_finite(message, "amplitude.frequency_slope", b->amplitude[j].frequency_slope);
        vi_check_finite(message, "amplitude.damping_slope", b->amplitude[j].damping_slope);
        vi_check_not_negative(message, "amplitude.damping_reciprocal", b->amplitude[j].damping_reciprocal);
    }
    vi_check_each(message, vi_check_finite, "modal_displacement_start", b->modal_displacement_start, n);
    vi_check_each(message, vi_check_finite, "modal_velocity_start", b->modal_velocity_start, n);
}

void beam_check_amplitude(const void *self, char message[VI_MESSAGE_LENGTH])
{
    vi_check_finite(message, "forcing.amplitude", ((const beam *)self)->forcing_amplitude);
}

static void check_forcing(const beam *b, char *message)
{
    check_choice(message, "forcing.kind", b->forcing_kind, FORCED_BY_BASE);
    beam_check_amplitude(b, message);
    if (b->forcing_kind == FORCED_AS_MODE && (b->forcing_mode < 1 || b->forcing_mode > b->modes)) {
        vi_complain(message, "forcing.mode: expected 1 to %lld (modes), got %lld", (long long)b->modes,
                    (long long)b->forcing_mode);
    }
    check_location(message, "forcing_location", b->forcing_location);
}

static void check_places(const beam *b, char *message)
{
    check_location(message, "sensor_location", b->sensor_location);
    char name[32];
    for (int k = 0; k < BEAM_SENSORS; ++k) {
        (void)snprintf(name, sizeof name, "sensor[%d].location", k + 1);
        check_location(message, name, b->sensor[k].location);
    }
    for (int k = 0; k < VI_PORTS; ++k) {
        if (!vi_contact_law_is_none(b->body.contacts[k].law.law)) {
            (void)snprintf(name, sizeof name, "contact[%d].location", k + 1);
            check_location(message, name, b->contact_location[k]);
        }
    }
}

void beam_check_inputs(const void *self, char message[VI_MESSAGE_LENGTH])
{
    const beam *b = self;
    vi_check_finite(message, "force", b->force);
    vi_check_finite(message, "force_rate", b->force_rate);
}

/* A residual vector has its full mass. A rigid stop would need the mass of all modes beyond, which is 0. */
static void check_residual(const beam *b, char *message)
{
    for (int k = 0; b->residual && k < VI_PORTS; ++k) {
        const int64_t law = b->body.contacts[k].law.law;
        if (!vi_contact_law_is_none(law) && !vi_contact_law_yields(law)) {
            vi_complain(message, "contact[%d].law: expected a stop that yields beside residual, got one that does not",
                        k + 1);
        }
    }
}

void beam_check(const beam *b, char message[VI_MESSAGE_LENGTH])
{
    if (b->modes < 1 || b->modes > b->modes_described) {
        vi_complain(message, "modes: expected 1 to %lld, got %lld", (long long)b->modes_described, (long long)b->modes);
        return;
    }
    check_choice(message, "boundary", b->boundary, VI_PINNED_PINNED);
    check_section(b, message);
    check_modes(b, message);
    check_forcing(b, message);
    check_choice(message, "impact_projection", b->impact_projection, PROJECTION_COLLOCATION);
    check_places(b, message);
    check_residual(b, message);
    vi_body_check(&b->body, message);
    beam_check_inputs(b, message);
}
