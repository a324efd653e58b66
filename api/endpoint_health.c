#include "endpoint.h"

struct health {
    const char *status;
};

static const struct field response_fields[] = {
    {MEMBER(struct health, status), FIELD_TEXT, FIELD_MUST, .doc = "\"ok\": the process answers"},
    {0},
};

static bool handle(struct call *call)
{
    ((struct health *)call->out)->status = "ok";
    return true;
}

const struct endpoint api_endpoint_health = {
    .method = "GET",
    .path = "/healthz",
    .summary = "Liveness",
    .response = response_fields,
    .response_size = sizeof(struct health),
    .is_probe = true,
    .handle = handle,
};
