"""The application: all routes, described by its own OpenAPI document."""

from __future__ import annotations

from fastapi import FastAPI, Response
from fastapi.responses import PlainTextResponse

from vibroimpact.analysis.dataset.provenance import versions
from vibroimpact.service.metrics import CONTENT_TYPE, exposition
from vibroimpact.service.page_api import page_routes
from vibroimpact.service.page_files import serve_page
from vibroimpact.service.problems import answer_problems
from vibroimpact.service.routes.campaigns import campaigns_router
from vibroimpact.service.routes.described import PREFIX, problems
from vibroimpact.service.routes.estimates import estimates_router
from vibroimpact.service.routes.events import events_router
from vibroimpact.service.routes.fmus import fmus_router
from vibroimpact.service.routes.recordings import recordings_router
from vibroimpact.service.routes.results import results_router
from vibroimpact.service.routes.scenes import scenes_router
from vibroimpact.service.routes.uploads import Uploads
from vibroimpact.service.scenes import Shelf
from vibroimpact.service.sessions import Sessions
from vibroimpact.service.store import Store
from vibroimpact.service.supervisor import Supervisor


def application(store: Store, supervisor: Supervisor, shelf: Shelf, sessions: Sessions) -> FastAPI:
    """Return the application over a store, its supervisor, the files for scenes, and the sessions of the page."""
    app = FastAPI(
        title="vibroimpact",
        version=versions()["vibroimpact"],
        description="Campaigns of vibro-impact scenes: submitted, followed, resumed, fetched.",
        docs_url=None,
        redoc_url=None,
        openapi_url=f"{PREFIX}/openapi.json",
    )
    answer_problems(app)

    @app.get("/healthz", response_class=PlainTextResponse, summary="Whether the service answers")
    async def healthz() -> str:  # needs no thread, so it answers even when all are busy
        return "ok\n"

    @app.get("/metrics", response_class=PlainTextResponse, responses=problems(), summary="For Prometheus")
    def metrics() -> Response:
        return Response(exposition(store), media_type=CONTENT_TYPE)

    uploads = Uploads(store.folder)
    routers = (
        campaigns_router(store, supervisor, shelf),
        events_router(store),
        results_router(store),
        recordings_router(shelf.recordings, uploads),
        estimates_router(store, shelf.recordings),
        scenes_router(shelf),
        fmus_router(shelf.fmus, uploads),
        page_routes(store, shelf, sessions),
    )
    for router in routers:
        app.include_router(router, prefix=PREFIX)
    serve_page(app)
    return app
