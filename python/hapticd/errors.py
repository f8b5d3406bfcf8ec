"""Exceptions of the client. Wrong arguments are ValueError instead."""


class Error(Exception):
    """A failure between client and server. The text names both, the cause and, where there is one, the remedy."""


class ConnectError(Error, ConnectionError):
    """There is no connection, or the server has no such device."""


class ConnectionLost(Error, ConnectionError):
    """The connection ended while data was being sent, or the server accepted no data for send_timeout; there is none
    for a call that needs it; or the client is closed."""


class Unsupported(Error):
    """The server or its device does not support the call: another make, an older version, or another kind of
    device."""


class ServerError(Error):
    """The server refused a command; the text is the server's. Only with throw_on_error."""


class RecordingError(Error):
    """A recording cannot be read; the text names the file, the byte and the remedy."""
